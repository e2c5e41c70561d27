"""The list of guards that ``tests/hazards/without.py`` takes out still names what the program does."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from hazards.without import GUARDS, LATE, Guard, place

PAGE = Path(__file__).parents[2] / "docs/safety.md"


@pytest.mark.parametrize("guard", [*GUARDS, *LATE], ids=lambda guard: guard.what)
def test_every_guard_stands_where_it_can_be_taken_out(guard: Guard) -> None:
    assert place(guard.old).suffix == ".py"


def test_every_line_of_the_hazard_table_has_a_guard() -> None:
    named = re.findall(r"`(tests/\w+/test_\w+\.py::[^`]+)` \|$", PAGE.read_text(encoding="utf-8"), re.M)
    shown = {name.split("[")[0] for name in named}
    assert len(shown) > 20
    assert not shown - {guard.shown_by.split("[")[0] for guard in GUARDS}
