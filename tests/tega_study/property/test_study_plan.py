"""A study's order is balanced, and nothing that was kept is lost wherever the events are cut."""

from __future__ import annotations

import itertools
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from tega_study.journal import events_path, read_events
from tega_study.order import allocate, williams
from tega_study.plan import make_plan, read_plan, write_plan
from tega_study.state import derive, resume

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
