"""A Fitts test's arithmetic: cases by hand, what has to hold for any course of the cursor; a practice's score."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tega.errors import InvalidValueError
from tega_practice.fitts import CONDITIONS, FittsCondition, Movement, fitts_score, index_of_difficulty
from tega_practice.live import FittsCourse, FittsMovement, Target, fitts_plan
from tega_practice.tracking import Curve, score


def moved(start: float, end: float | None, **more: Any) -> Movement:
    """Return a movement of a second to 0.75 ± 0.1, straight to its end."""
    entry = start if end is None else end
    straight = Movement(0.5, 0.2, 0.75, start, entry, end, 1.0, abs(entry - start), 0, inside_at_start=False)
    return straight._replace(**more)


def only(movements: list[Movement], step: float = 0.0) -> FittsCondition:
    (found,) = fitts_score(movements, cursor_step=step).conditions
    return found


def test_index_of_difficulty_is_shannons() -> None:
    assert index_of_difficulty(0.75, 0.25) == 2.0
    assert index_of_difficulty(0.5, 0.5) == 1.0
    with pytest.raises(InvalidValueError, match=r"width = 0 .* above 0"):
        index_of_difficulty(0.5, 0.0)


def test_a_condition_by_hand() -> None:
    # End-points 0.04 to either side of the centre: sd with n - 1 is 0.04 √2, mean distance 0.5, mean time 1.5 s.
    found = only([moved(0.25, 0.71, time_s=1.0), moved(0.25, 0.79, time_s=2.0)])
    width = 4.133 * 0.04 * math.sqrt(2)
    assert found.effective_width == pytest.approx(width)
    assert found.effective_distance == pytest.approx(0.5)
    assert found.effective_id_bits == pytest.approx(math.log2(0.5 / width + 1))
    assert found.throughput_bits_s == pytest.approx(math.log2(0.5 / width + 1) / 1.5)
    assert found.movement_time_s == 1.5
    assert found.id_bits == pytest.approx(math.log2(3.5))


def test_ends_of_both_directions_go_together_along_the_movement() -> None:
    # Both stop 0.05 short: no scatter but the cursor's own step of 0.25.
    there = moved(0.25, 0.70)
    back = moved(0.75, 0.30, centre=0.25)
    found = only([there, back], step=0.25)
    assert found.effective_width == pytest.approx(4.133 * 0.25 / math.sqrt(12))
    assert found.throughput_bits_s == pytest.approx(math.log2(0.45 / (4.133 * 0.25 / math.sqrt(12)) + 1))


def test_time_that_brought_nothing_counts_as_time() -> None:
    ends = [moved(0.25, 0.71), moved(0.25, 0.79)]
    whole = only(ends)
    late = only([*ends, moved(0.25, None, time_s=10.0)])
    assert late.throughput_bits_s == pytest.approx(whole.throughput_bits_s * 2 / 12)
    assert late.movement_time_s == 1.0
    assert (late.completed, late.movements) == (2, 3)
    # One end has no scatter, and carries nothing.
    found = only([moved(0.25, 0.75), moved(0.25, None, time_s=10.0)])
    assert (found.throughput_bits_s, found.effective_width) == (0.0, None)


def test_the_whole_score_by_hand() -> None:
    whole = fitts_score(
        [
            moved(0.25, 0.71, path=0.92, overshoots=2),
            moved(0.25, 0.79),
            moved(0.25, None, time_s=10.0, overshoots=1),
            moved(0.5, 0.74, distance=0.25),
        ],
        cursor_step=0.0,
    )
    assert (whole.completion, whole.overshoots, whole.movements) == (0.75, 0.75, 4)
    assert whole.path_efficiency == pytest.approx((0.5 + 1 + 1) / 3)
    assert whole.throughput_bits_s == pytest.approx(whole.conditions[1].throughput_bits_s / 2)
    with pytest.raises(InvalidValueError, match="no movement that counts"):
        fitts_score([moved(0.7, 0.75)._replace(inside_at_start=True)], cursor_step=0.01)


ENDS = st.lists(st.floats(0.66, 0.84), min_size=2, max_size=12)


@given(ends=ENDS, step=st.floats(0, 0.25), slower=st.floats(1.01, 5))
def test_slower_is_less_and_in_proportion(ends: list[float], step: float, slower: float) -> None:
    assume(step > 0 or max(ends) - min(ends) > 1e-6)
    quick = only([moved(0.25, end) for end in ends], step)
    slow = only([moved(0.25, end, time_s=slower) for end in ends], step)
    assert slow.throughput_bits_s == pytest.approx(quick.throughput_bits_s / slower)


@given(ends=ENDS, step=st.floats(0.001, 0.2))
def test_a_coarser_cursor_never_carries_more(ends: list[float], step: float) -> None:
    fine, coarse = (only([moved(0.25, end) for end in ends], s) for s in (step, 1.2 * step))
    assert coarse.throughput_bits_s < fine.throughput_bits_s


@given(ends=ENDS, by=st.floats(-0.2, 0.2))
def test_the_same_scatter_elsewhere_is_as_good(ends: list[float], by: float) -> None:
    here = only([moved(0.25, end) for end in ends], 0.01)
    there = only([moved(0.25 + by, end + by, centre=0.75 + by) for end in ends], 0.01)
    assert there.throughput_bits_s == pytest.approx(here.throughput_bits_s)


CURSOR = st.lists(st.floats(0, 1), min_size=1, max_size=300)


@given(cursor=CURSOR, seed=st.integers(0, 5))
def test_any_course_of_the_cursor_gives_figures_within_their_ranges(cursor: list[float], seed: int) -> None:
    course = FittsCourse(fitts_plan(seed, movements=2), dwell_s=0.3, timeout_s=2.0)
    for n, closure in enumerate(cursor):
        course.take(0.1 * n, closure)
    for one in course.movements:
        assert 0 <= one.time_s <= 2.0
        assert abs(one.entry - one.start) <= one.path + 1e-9
        assert one.endpoint is None or abs(one.endpoint - one.centre) <= one.width / 2 + 1e-9
        assert one.overshoots >= 0
    if any(not one.inside_at_start for one in course.movements):
        found = fitts_score(course.movements, cursor_step=0.01)
        assert 0 <= found.completion <= 1
        assert found.path_efficiency is None or 0 <= found.path_efficiency <= 1 + 1e-9
        assert 0 <= found.throughput_bits_s < math.inf


def test_a_target_is_hit_by_dwelling_in_it() -> None:
    requested = [FittsMovement(Target(centre, 0.2), 0.5, counts=True) for centre in (0.5, 0.0)]
    course = FittsCourse(requested, dwell_s=0.2, timeout_s=5.0)
    cursor = [0.0, 0.3, 0.45, 0.65, 0.55, 0.48, 0.5]
    for n, closure in enumerate(cursor):
        course.take(0.1 * n, closure)
    (one,) = course.movements
    # In at 0.45, out at 0.65 (one overshoot), in for good at 0.55 after 0.4 s; the dwell ends 0.2 s later.
    assert (one.overshoots, one.start, one.entry) == (1, 0.0, 0.55)
    assert one.time_s == pytest.approx(0.4)
    assert one.endpoint == 0.5
    assert one.path == pytest.approx(0.65 + 0.1)
    assert course.target == Target(0.0, 0.2)
    for n in range(7, 58):
        course.take(0.1 * n, 0.5)
    assert course.movements[1].endpoint is None
    assert course.movements[1].time_s == 5.0
    assert course.target is None


@given(seed=st.integers(0, 1000), movements=st.integers(1, 8))
def test_a_plan_asks_each_condition_as_often(seed: int, movements: int) -> None:
    plan = fitts_plan(seed, movements=movements)
    counted = [one for one in plan if one.counts]
    assert len(plan) == len(CONDITIONS) * (movements + 1)
    for low, high, width in CONDITIONS:
        of_it = [a for a in counted if a.target.width == width and a.target.centre in {low, high}]
        assert len(of_it) >= movements
    assert all(one.target.low > 0 and one.target.high < 1 for one in plan)
    assert plan == fitts_plan(seed, movements=movements)


@given(st.floats(10, 40), st.integers(0, 1000), st.integers(0, 9))
def test_a_perfect_follower_scores_full_and_a_late_one_is_as_late_as_they_were(
    duration_s: float, seed: int, late: int
) -> None:
    curve = Curve(duration_s, seed=seed)
    t_s = [k / 10 for k in range(int(duration_s * 10))]
    requested = [curve.at(t) for t in t_s]
    assert 1 <= min(requested) <= max(requested) <= 5
    on_time = score(t_s, [round(a) for a in requested], curve)
    assert on_time.in_target == 1.0
    assert on_time.rms_error_levels < 0.5
    delayed = score(t_s, [round(curve.at(t - late / 10)) for t in t_s], curve)
    assert delayed.delay_s is not None
    assert abs(delayed.delay_s - late / 10) <= 0.1001
    assert score(t_s, [1] * len(t_s), curve).delay_s is None
