"""The steadied level of a closure: early where effort has changed, steady where it only trembles."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tega_learn.decoders import ProportionalDecoder, fit
from tega_learn.learned import Latch

BLOCK_S = 0.1


def latched(closures: list[float]) -> list[int]:
    """Return the level at each block of closures that are smoothed as a model's are."""
    latch, found, smoothed = Latch(BLOCK_S), [], closures[0]
    for closure in closures:
        smoothed += 0.35 * (closure - smoothed)
        latch.take(closure, smoothed)
        found.append(latch.level)
    return found


@given(closures=st.lists(st.floats(0, 1), min_size=1, max_size=200))
def test_a_level_is_one_of_five_and_goes_the_way_of_the_newest_block(closures: list[float]) -> None:
    levels = latched(closures)
    assert levels[0] == min(5, int(1 + 4 * closures[0] + 0.5))
    for before, now, closure in zip(levels, levels[1:], closures[1:], strict=False):
        assert now in {1, 2, 3, 4, 5}
        assert (now - before) * (1 + 4 * closure - before) >= 0


@given(closures=st.lists(st.integers(0, 16), min_size=1, max_size=200))
def test_open_and_closed_are_treated_alike(closures: list[int]) -> None:
    """But for closures on a border, of which the higher level is taken."""
    away = [0.001 + 0.998 * n / 16 for n in closures]
    assert [6 - level for level in latched([1 - c for c in away])] == latched(away)


def rising(first: float, last: float, blocks: int = 3) -> list[float]:
    """Return the closures of an effort that changes as muscles do, in three blocks."""
    return [first + (last - first) * n / blocks for n in range(1, blocks + 1)]


@pytest.mark.parametrize(("levels_away", "blocks"), [(4, 2), (3, 2), (2, 3), (1, 8)])
def test_the_farther_the_sooner(levels_away: int, blocks: int) -> None:
    closure = levels_away / 4
    reported = latched([0.0] * 50 + rising(0.0, closure) + [closure] * 50)
    assert reported[49] == 1
    assert next(n for n, level in enumerate(reported) if level > 1) - 49 == blocks
    assert reported[50 + 12] == 1 + levels_away
    assert len(set(reported[62:])) == 1


def test_a_jump_within_a_block_is_too_high_by_one_level_for_two_seconds_at_most() -> None:
    reported = latched([0.0] * 50 + [0.5] * 50)
    assert reported[50] == 4
    assert reported[71:] == [3] * len(reported[71:])


def test_a_steady_effort_that_trembles_by_a_level_keeps_its_level() -> None:
    rng = np.random.default_rng(1)
    reported = latched([0.5, *rng.normal(0.5, 0.125, 10_000).clip(0, 1)])
    assert np.count_nonzero(np.diff(reported)) / (len(reported) * BLOCK_S) < 0.1


def changed_after(closures: list[float], first: int, level: int) -> int:
    return next(n for n, reported in enumerate(latched(closures)[first:]) if reported == level)


def test_a_change_back_needs_more_than_a_change_onwards() -> None:
    up = [0.0] * 50 + rising(0.0, 0.5)
    soon, later = up + [0.5] * 2, up + [0.5] * 60
    down, on = [0.25] * 30, [0.75] * 30
    assert latched(soon)[-1] == latched(later)[-1] == 3
    assert changed_after(soon + down, len(soon), 2) > changed_after(soon + on, len(soon), 4)
    assert changed_after(soon + down, len(soon), 2) > changed_after(later + down, len(later), 2)


def test_a_level_that_has_changed_often_of_late_is_changed_later() -> None:
    steady = [0.0] * 200
    busy = steady + ([1.0] * 8 + [0.0] * 8) * 12
    assert changed_after(steady + [0.25] * 40, len(steady), 2) < changed_after(
        busy + [0.25] * 60, len(busy), 2
    )


def test_what_is_printed_is_short_and_escapes_names() -> None:
    hostile = '<script>alert("x")</script>&'
    rng = np.random.default_rng(1)
    closure = np.repeat([0.0, 1.0, 0.0, 0.5, 0.0, 1.0] * 2, 400)
    samples = rng.normal(size=(len(closure), 2)) * (5 + 100 * closure[:, None])
    decoder = fit(samples, closure, rate_hz=200, tau=20, channels=(hostile, "b"), person=hostile)
    assert "<script>" not in decoder._repr_html_()
    assert "200 Hz" in repr(decoder)
    assert repr(ProportionalDecoder(200, [1.0], tau=20)) == (
        "<ProportionalDecoder: raw, 200 Hz, closes by channel 0>"
    )
