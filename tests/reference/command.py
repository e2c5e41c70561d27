"""``tega-teleop`` called as from a shell."""

from __future__ import annotations

import pytest

from tega.ui.cli.main import main


def call(capsys: pytest.CaptureFixture[str], *words: object, code: int = 0) -> tuple[str, str]:
    """Run a command that ends with this code, and return what it printed and what it told."""
    with pytest.raises(SystemExit) as ended:
        main([str(w) for w in words])
    captured = capsys.readouterr()
    assert ended.value.code == code, captured
    return captured.out, captured.err
