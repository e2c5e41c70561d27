"""The steadied level of a closure: early where effort has changed, steady where it only trembles."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tega.decoders.latch import Latch

BLOCK_S = 0.1


def latched(closures: list[float]) -> list[int]:
    latch, found = Latch(BLOCK_S), []
    for closure in closures:
        latch.take(closure)
        found.append(latch.level)
    return found


@given(closures=st.lists(st.floats(0, 1), min_size=1, max_size=200))
def test_a_level_is_one_of_five_and_changes_to_the_newest_blocks_own(closures: list[float]) -> None:
    levels = latched(closures)
    assert levels[0] == min(5, int(1 + 4 * closures[0] + 0.5))
    for before, now, closure in zip(levels, levels[1:], closures[1:], strict=False):
        assert now in {before, min(5, int(1 + 4 * closure + 0.5))}


@given(closures=st.lists(st.floats(0, 1), min_size=1, max_size=200))
def test_open_and_closed_are_treated_alike(closures: list[float]) -> None:
    """But for closures on a border, of which the higher level is taken."""
    if any(abs((4 * c) % 1 - 0.5) < 1e-6 for c in closures):
        return
    mirrored = latched([1 - c for c in closures])
    assert [6 - level for level in mirrored] == latched(closures)


@pytest.mark.parametrize(("levels_away", "blocks"), [(4, 1), (3, 2), (2, 2), (1, 9)])
def test_the_farther_the_sooner(levels_away: int, blocks: int) -> None:
    told = latched([0.0] * 50 + [levels_away / 4] * 50)
    assert told[49] == 1
    assert told.index(1 + levels_away) - 49 == blocks


def test_a_steady_effort_that_trembles_by_a_level_keeps_its_level() -> None:
    rng = np.random.default_rng(1)
    told = latched([0.5, *rng.normal(0.5, 0.125, 10_000).clip(0, 1)])
    assert np.count_nonzero(np.diff(told)) / (len(told) * BLOCK_S) < 0.1


def test_a_change_soon_after_another_needs_more() -> None:
    at_once = latched([0.0] * 50 + [1.0] * 50)
    back = latched([0.0] * 50 + [1.0] + [0.0] * 20)
    assert at_once.index(5) == 50
    assert back[50] == 5
    assert back[51] == 5  # after a second it would be 1 at once
    assert back[55] == 1
