"""The list of guards that ``tests/hazards/without.py`` takes out still names what the program does."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from hazards.guards import GUARDS, LATE, Guard
from hazards.without import place, read_page

PAGE = Path(__file__).parents[2] / "docs/evidence/safety.md"


@pytest.mark.parametrize("guard", [*GUARDS, *LATE], ids=lambda guard: guard.what)
def test_every_guard_stands_where_it_can_be_taken_out(guard: Guard) -> None:
    assert place(guard.old).suffix == ".py"


def test_every_line_of_the_hazard_table_has_a_guard() -> None:
    named = re.findall(r"`(tests/\w+/test_\w+\.py::[^`]+)` \|$", PAGE.read_text(encoding="utf-8"), re.M)
    displayed = {name.split("[")[0] for name in named}
    assert len(displayed) > 20
    assert not displayed - {guard.shown_by.split("[")[0] for guard in GUARDS}


@pytest.mark.parametrize("guard", [*GUARDS, *LATE], ids=lambda guard: guard.what)
def test_the_page_has_every_guard_and_none_that_was_taken_out_unseen(guard: Guard) -> None:
    # What is unproven, on a machine that was busy, stands there as such; what survives is a hole.
    assert "SURVIVES" not in read_page()[guard.what, guard.shown_by][3]
