"""The study's statistics against enumeration, hand calculation, and the properties they must have."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

pytest.importorskip("scipy")

from scipy import stats

from tega_study.coupling import TouchCourse, dwell, lag_sweep, on_grid, pearson, transitions
from tega_study.people import ratio_of_means, sign_flip, within_person
from tega_study.rank import holm, mann_whitney, rank_biserial_interval, shift

small = st.lists(st.integers(0, 6).map(float), min_size=1, max_size=7)


def u_of(x: list[float], y: list[float]) -> Fraction:
    return Fraction(sum((a > b) + (a >= b) for a in x for b in y), 2)


def enumerated_p(x: list[float], y: list[float]) -> Fraction:
    """Twice the smaller tail of U over all ways to split the values, in fractions."""
    values, seen, us = x + y, u_of(x, y), list[Fraction]()
    for chosen in itertools.combinations(range(len(values)), len(x)):
        second = [values[i] for i in range(len(values)) if i not in chosen]
        us.append(u_of([values[i] for i in chosen], second))
    return min(
        Fraction(1), 2 * Fraction(min(sum(u <= seen for u in us), sum(u >= seen for u in us)), len(us))
    )


@settings(max_examples=25)
@given(small, small)
def test_mann_whitney_equals_full_enumeration_with_and_without_ties(x: list[float], y: list[float]) -> None:
    assume(len(x) + len(y) <= 11)
    found = mann_whitney(x, y)
    assert found.u == u_of(x, y)
    assert found.p_conditional == pytest.approx(float(enumerated_p(x, y)), abs=1e-12)
    exact = len(set(x + y)) == len(x) + len(y)
    assert found.method == ("exact" if exact else "asymptotic")
    assert found.p == (found.p_conditional if exact else found.p_asymptotic)
    assert -1 <= found.low <= found.rank_biserial <= found.high <= 1


@given(small, small)
def test_exchanging_the_groups_turns_the_effect_and_keeps_p(x: list[float], y: list[float]) -> None:
    one, other = mann_whitney(x, y), mann_whitney(y, x)
    assert one.p_conditional == pytest.approx(other.p_conditional)
    assert one.rank_biserial == pytest.approx(-other.rank_biserial)
    assert one.low == pytest.approx(-other.high, abs=1e-9)
    assert one.high == pytest.approx(-other.low, abs=1e-9)
    assert shift(x, y).estimate == pytest.approx(-shift(y, x).estimate)


@given(st.floats(0, 1), st.integers(1, 60), st.integers(1, 60))
def test_the_rank_biserial_interval_has_the_effect_in_it_and_a_width(a: float, n: int, m: int) -> None:
    low, high = rank_biserial_interval(a, n, m)
    assert -1 <= low <= 2 * a - 1 + 1e-12
    assert 2 * a - 1 - 1e-12 <= high <= 1
    assert high > low


def test_the_rank_biserial_interval_covers() -> None:
    """Normal groups, 10 against 10, shifted by one SD: A = Phi(1 / sqrt 2)."""
    random = np.random.default_rng(1)
    true = 2 * (0.5 * (1 + math.erf(0.5))) - 1
    hits = 0
    for _ in range(200):
        x, y = random.normal(1, 1, 10), random.normal(0, 1, 10)
        low, high = rank_biserial_interval(float(np.mean(np.greater.outer(x, y))), 10, 10)
        hits += low <= true <= high
    assert 0.91 <= hits / 200 <= 0.985


@given(st.lists(st.floats(0, 1), min_size=1, max_size=8))
def test_holm_is_its_definition(p: list[float]) -> None:
    m, order = len(p), sorted(range(len(p)), key=p.__getitem__)
    found = holm(p)
    for place, index in enumerate(order):
        wanted = max(min(1.0, (m - k) * p[order[k]]) for k in range(place + 1))
        assert found[index] == pytest.approx(wanted)
    assert all(one is not None and one >= raw for one, raw in zip(found, p, strict=True))


@given(st.lists(st.integers(-30, 30), min_size=2, max_size=8))
def test_sign_flip_equals_scipys(values: list[int]) -> None:
    found = stats.permutation_test((np.array(values),), np.sum, permutation_type="samples", vectorized=True)
    assert sign_flip([v / 10 for v in values]) == pytest.approx(found.pvalue, abs=1e-12)


@settings(max_examples=30)
@given(
    st.lists(st.tuples(*[st.lists(st.integers(0, 5), min_size=3, max_size=3)] * 2), min_size=1, max_size=2)
)
def test_within_person_equals_enumeration(groups: list[tuple[list[int], list[int]]]) -> None:
    seen = sum(sum(a) for a, _ in groups)
    expected = Fraction(sum(sum(a) + sum(b) for a, b in groups), 2)
    per_person = [[sum(c) for c in itertools.combinations(a + b, 3)] for a, b in groups]
    sums = [sum(one) for one in itertools.product(*per_person)]
    wanted = Fraction(sum(abs(s - expected) >= abs(seen - expected) for s in sums), len(sums))
    assert within_person(groups) == pytest.approx(float(wanted), abs=1e-12)


@given(st.lists(st.tuples(st.integers(1, 9), st.integers(1, 9)), min_size=2, max_size=8), st.floats(0.1, 10))
def test_the_ratio_of_means_does_not_depend_on_the_scale(pairs: list[tuple[int, int]], scale: float) -> None:
    a, b = [p[0] for p in pairs], [p[1] for p in pairs]
    one, scaled = ratio_of_means(a, b), ratio_of_means([scale * v for v in a], [scale * v for v in b])
    assume(one is not None and scaled is not None)
    assert one is not None
    assert scaled is not None
    assert one.low <= one.ratio <= one.high
    assert scaled.ratio == pytest.approx(one.ratio)
    assert scaled.p == pytest.approx(one.p, abs=1e-9)


@given(st.integers(0, 2**31), st.integers(-8, 8))
def test_a_delay_is_found_as_its_lag(seed: int, delay: int) -> None:
    noise = np.random.default_rng(seed).normal(size=140)
    pose, touch = noise[20:120], noise[20 - delay : 120 - delay]
    best = max(lag_sweep(pose, touch, most=8), key=lambda one: one[1])
    assert best[0] == delay
    assert best[1] == pytest.approx(1.0)


@given(st.lists(st.integers(0, 4), min_size=1, max_size=60))
def test_dwell_and_transitions_count_what_is_there(poses: list[int]) -> None:
    pose = np.array(poses, float)
    shares = dwell(pose)
    assert sum(shares) == pytest.approx(1.0)
    assert [round(share * len(poses)) for share in shares] == [poses.count(level) for level in range(5)]
    changes = [(a, b) for a, b in itertools.pairwise(poses) if a != b]
    assert transitions(pose) == (len(changes), sum(0 < a < 4 or 0 < b < 4 for a, b in changes))


@given(st.floats(-5, 5), st.floats(0.1, 9))
def test_pearson_keeps_under_shift_and_scale(move: float, scale: float) -> None:
    x, y = np.arange(10.0) ** 2, np.sin(np.arange(10.0))
    assert pearson(x * scale + move, y) == pytest.approx(pearson(x, y))
    assert pearson(-x, y) == pytest.approx(-pearson(x, y))
    assert math.isnan(pearson(np.ones(10), y))


def test_the_grid_has_the_mean_of_each_cell_and_the_pose_that_held_at_its_end() -> None:
    t_s = np.array([0.0, 1, 2, 3, 7, 8]) / 30
    course = TouchCourse(t_s, np.array([0, 3, 6, 1, 2, 4.0]), np.zeros(6), np.array([0, 1, 2, 3, 4, 1.0]))
    even = on_grid(course)
    assert even.t_s.tolist() == pytest.approx([0.1, 0.2, 0.3])
    assert even.cci.tolist() == [3, 1, 3]
    assert even.pose.tolist() == [2, 3, 1]
