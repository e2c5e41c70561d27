"""The picture of the observer's console on the page is made by a command, through the console's own pilot."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner


def test_the_console_is_drawn_as_it_was_driven(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("textual")
    from tega_figures import study_console as picture

    monkeypatch.setattr(picture, "KEYS", tuple((key, 0.05) for key, _ in picture.KEYS))
    done = CliRunner().invoke(picture.main, [str(tmp_path / "console.svg")], catch_exceptions=False)
    assert done.exit_code == 0
    drawn = (tmp_path / "console.svg").read_text(encoding="utf-8").replace("&#160;", " ")
    assert drawn.startswith("<svg")
    assert "TRIAL 1 · container" in drawn
    assert "trial 1, 4 scored" in drawn, "six keys, of which u takes one event back"
