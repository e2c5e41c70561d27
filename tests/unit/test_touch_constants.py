"""How far the tracker's constants may be moved is asked of constants that there are, and told value by value."""

from __future__ import annotations

import pytest

from tega_figures.touch_constants import TRIED, chosen, table


@pytest.mark.parametrize("name", TRIED)
def test_a_constant_is_moved_both_ways(name: str) -> None:
    _, value = chosen(name)
    assert min(TRIED[name]) < value < max(TRIED[name])


def test_a_constant_that_is_not_there_is_told() -> None:
    with pytest.raises(LookupError, match="no constant TRACES"):
        chosen("TRACES")


def test_the_table_parts_what_holds_from_what_does_not() -> None:
    told = table({"TRACE": {"0.125": [], "0.135": ["test_a_gripper_finger_feels_what_its_force_says"]}})
    assert told.splitlines()[2:] == [
        "| `TRACE` | 0.13 | 0.125 | 0.135: a gripper finger feels what its force says |"
    ]
