"""How far the tracker's constants may be moved is asked of constants that there are, and told value by value."""

from __future__ import annotations

import re

import pytest

from tega_figures.touch_constants import SOURCES, TRIED, asking, chosen, table
from tega_figures.touch_peers.other_build import PROJECT


@pytest.mark.parametrize("name", TRIED)
def test_a_constant_is_moved_both_ways(name: str) -> None:
    _, value = chosen(name)
    assert min(TRIED[name]) < value < max(TRIED[name])


def test_a_constant_that_is_not_there_is_told() -> None:
    with pytest.raises(LookupError, match="no constant TRACES"):
        chosen("TRACES")


def test_each_constant_is_asked_of_the_environment_and_is_the_chosen_one_where_that_has_none() -> None:
    sources = [(PROJECT / path).read_text(encoding="utf-8") for path in SOURCES]
    for name in TRIED:
        (source,) = [one for one in sources if re.search(rf"^const {name}:", one, re.MULTILINE)]
        built = asking(source)
        _, value = chosen(name)
        uses = len(re.findall(rf"\b{name}\b", source)) - 1
        assert f'"TRACKER_{name}").map_or({value!r},' in built
        assert not re.search(rf"\b{name}\b", built)
        assert uses
        assert built.count(f"asked_{name.lower()}()") == uses + 1
        assert len(built.splitlines()) == len(source.splitlines())


def test_the_table_parts_what_holds_from_what_does_not() -> None:
    told = table({"TRACE": {"0.125": [], "0.135": ["test_a_gripper_finger_feels_what_its_force_says"]}})
    assert told.splitlines()[2:] == [
        "| `TRACE` | 0.13 | 0.125 | 0.135: a gripper finger feels what its force says |"
    ]
