"""A study's order is balanced, its events survive any cut, and its statistics are those of enumeration and by hand."""

from __future__ import annotations

import itertools
import math
import tempfile
from collections import Counter
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from tega_study.journal import events_path, read_events
from tega_study.order import allocate, williams
from tega_study.plan import make_plan, read_plan, write_plan
from tega_study.state import derive, resume

pytest.importorskip("scipy")

from scipy import stats

from tega_study.coupling import TouchCourse, dwell, lag_sweep, on_grid, transitions
from tega_study.people import sign_flip, within_person
from tega_study.rank import holm, mann_whitney, rank_biserial_interval, shift

OBJECTS = ["bottle", "container", "bag", "cup", "box"]
CONDITIONS = ["haptic", "non-haptic", "event-gated", "sham"]

studies = st.fixed_dictionaries(
    {
        "participants": st.integers(1, 14),
        "seed": st.integers(0, 2**40),
        "objects": st.integers(1, 4).map(lambda n: OBJECTS[:n]),
        "conditions": st.integers(2, 4).map(lambda n: CONDITIONS[:n]),
        "trials": st.integers(1, 5),
        "layout": st.sampled_from(["abba", "pairs", "period"]),
    }
)


@given(st.integers(1, 8))
def test_williams_has_every_neighbour_equally_often(n: int) -> None:
    rows = williams(n)
    places = Counter((place, value) for row in rows for place, value in enumerate(row))
    neighbours = Counter(pair for row in rows for pair in itertools.pairwise(row))
    assert len(set(places.values())) == 1
    assert len(places) == n * n
    assert len(neighbours) == n * (n - 1)
    assert len(set(neighbours.values())) <= 1


@given(st.integers(1, 40), st.integers(1, 4), st.integers(2, 4), st.integers(0, 2**40))
def test_orders_are_balanced_after_every_group_and_every_round(
    n: int, objects: int, conditions: int, seed: int
) -> None:
    found = allocate(n, OBJECTS[:objects], CONDITIONS[:conditions], seed=seed)
    group = len(williams(conditions))
    rows = {1: 1, 2: 2, 3: 6, 4: 4}[objects]
    assert len(found) == n
    for begin in range(0, n - group + 1, group):
        assert len({order for _, order in found[begin : begin + group]}) == group
        assert len({row for row, _ in found[begin : begin + group]}) == 1
    for begin in range(0, n - group * rows + 1, group * rows):
        assert len(set(found[begin : begin + group * rows])) == group * rows


@given(studies)
def test_every_trial_comes_exactly_once_and_the_plan_reads_back(study: dict[str, Any]) -> None:
    plan = make_plan(**study)
    assert plan == make_plan(**study)
    trials = range(1, study["trials"] + 1)
    wanted = {(o, c, k) for o in study["objects"] for c in study["conditions"] for k in trials}
    for person in plan.participants:
        mine = plan.of(person)
        assert [trial.trial for trial in mine] == list(range(1, len(mine) + 1))
        assert len(mine) == len(wanted)
        assert {(trial.object, trial.condition, trial.repeat) for trial in mine} == wanted
    with tempfile.TemporaryDirectory() as folder:
        write_plan(plan, Path(folder) / "study")
        assert read_plan(Path(folder) / "study") == plan


@given(st.integers(0, 2**40))
def test_abba_cancels_what_grows_evenly(seed: int) -> None:
    plan = make_plan(participants=2, seed=seed)
    for person, name in itertools.product(plan.participants, plan.settings.objects):
        mine = [trial for trial in plan.of(person) if trial.object == name]
        places = [sum(t.trial for t in mine if t.condition == c) for c in plan.settings.conditions]
        assert len(set(places)) == 1


@settings(max_examples=40)
@given(st.data())
def test_cut_at_any_byte_loses_no_complete_event_and_resumes_in_the_same_plan(data: st.DataObject) -> None:
    plan = make_plan(participants=1, seed=3, objects=["bottle"], trials=2)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "study"
        write_plan(plan, folder)
        path = events_path(folder, "p01")
        kinds: st.SearchStrategy[Any] = st.sampled_from(
            ["slip", "deformation", "note", "end", "abort", "crash"]
        )
        t_ns = 0
        while True:
            journal, state = resume(folder, plan, "p01", t_ns=t_ns)
            with journal:
                while state.next is not None:
                    trial, attempt = state.next
                    journal.add("trial_start", t_ns=t_ns, trial=trial, attempt=attempt)
                    for kind in data.draw(st.lists(kinds, max_size=4)):
                        t_ns += 1
                        if kind in {"end", "abort", "crash"}:
                            break
                        journal.add(kind, t_ns=t_ns, trial=trial, attempt=attempt, text="ü\n")
                    else:
                        kind = "end"
                    if kind == "crash":
                        break
                    status: Any = "done" if kind == "end" else "aborted_technical"
                    journal.add("trial_end", t_ns=t_ns, trial=trial, attempt=attempt, status=status)
                    state = derive(plan.of("p01"), journal.events)
            if state.next is None:
                break
        whole = path.read_bytes()
        events = read_events(path)
        cut = data.draw(st.integers(0, len(whole)))
        path.write_bytes(whole[:cut])
        kept = read_events(path)
        complete = whole[:cut].count(b"\n")
        assert kept == events[: len(kept)]
        assert len(kept) - complete in {0, 1}  # 1: all of the event is there but its newline
        journal, state = resume(folder, plan, "p01", t_ns=t_ns)
        with journal:
            assert journal.events[: len(kept)] == kept
            assert state == derive(plan.of("p01"), read_events(path))
            assert state.running is None
        assert read_plan(folder) == plan
        assert read_events(path)[: len(kept)] == kept


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


@given(st.lists(st.integers(-30, 30), min_size=2, max_size=8), st.integers(1, 12))
@example([5, -2, 3, -1, -4, 2], 3)
def test_sign_flip_equals_scipys(values: list[int], trials: int) -> None:
    found = stats.permutation_test((np.array(values),), np.sum, permutation_type="samples", vectorized=True)
    assert sign_flip([v / trials for v in values]) == pytest.approx(found.pvalue, abs=1e-12)


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


def test_the_grid_has_the_mean_of_each_cell_and_the_pose_that_held_at_its_end() -> None:
    t_s = np.array([0.0, 1, 2, 3, 7, 8]) / 30
    course = TouchCourse(t_s, np.array([0, 3, 6, 1, 2, 4.0]), np.zeros(6), np.array([0, 1, 2, 3, 4, 1.0]))
    even = on_grid(course)
    assert even.t_s.tolist() == pytest.approx([0.1, 0.2, 0.3])
    assert even.cci.tolist() == [3, 1, 3]
    assert even.pose.tolist() == [2, 3, 1]
