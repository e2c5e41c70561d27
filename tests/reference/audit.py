"""``tega-teleop audit`` as a test calls it."""

from __future__ import annotations

import json
from typing import Any

import pytest

from reference.command import call
from tega.ui.cli.main import main


def reported(*words: object, capsys: Any) -> list[dict[str, Any]]:
    """Run the verb with --json and return what it printed."""
    return json.loads(call(capsys, "audit", *words, "--json")[0])  # type: ignore[no-any-return]


def refused(*words: object, capsys: Any) -> str:
    with pytest.raises(SystemExit) as done:
        main(["audit", *map(str, words)])
    assert done.value.code != 0
    return str(capsys.readouterr().err)
