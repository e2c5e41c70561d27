"""Gather the accounts of a study's trials: raters, experimenter, camera, detector, and a simulated bench's truth."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import msgspec

from tega_study.detecting import DETECTOR, NOT_OBSERVABLE, read_detected
from tega_study.journal import SEEN, JournalEvent, Kind, attempts, counting, events_path, read_events
from tega_study.lead.running_trial import ARM
from tega_study.observers import CAMERA, read_measured, read_observers, saw_proposals, saw_whole
from tega_study.plan import read_plan
from tega_study.score.agree import Agreement, agreement
from tega_study.state import derive
from tega_study.study_notes import staying

TRUTH, EXPERIMENTER = "truth", "experimenter"
_PLACES = {TRUTH: 0, EXPERIMENTER: 2, CAMERA: 3, ARM: 4, DETECTOR: 5}
_NEVER: dict[str, frozenset[Kind]] = {
    DETECTOR: frozenset({"deformation", "drop"}),
    ARM: frozenset({"slip", "deformation"}),
}
"""Kinds of events that an account does not look for."""
TOLERANCE_S = 1.0
"""Tolerance for a live rater: seeing, deciding and pressing take 0.25 to 0.6 s, more for rare events."""


class Scored(NamedTuple):
    """A trial (person, trial, attempt) as one account has it.

    ``times_s`` are by kind or by the name in the plan, rising, from the trial's start and within it;
    ``unobservable`` the kinds that the account cannot have.
    """

    key: tuple[str, int, int]
    length_s: float
    times_s: dict[str, list[float]]
    unobservable: frozenset[str] = frozenset()


def scored_trials(folder: Path) -> dict[str, list[Scored]]:
    """Return the trials that count, as each account has them; trials it did not see whole are missing.

    The truth is that of a simulated bench, where the session's own rule saw the object's height.
    """
    plan = read_plan(folder)
    accounts: dict[str, list[Scored]] = {}
    for person in staying(folder, plan):
        main = read_events(events_path(folder, person))
        derive(plan.of(person), main)  # refuses events that do not fit one another
        raters = {
            **read_observers(folder, person),
            CAMERA: read_measured(folder, person),
            DETECTOR: read_detected(folder, person),
        }
        simulated = any(e.kind == "lift_off" and e.source == "auto" for e in main)
        pressed = any(e.kind in SEEN and e.source == EXPERIMENTER for e in main)
        for start, end in attempts(main, with_data=True):
            own = counting(main, start.trial, start.attempt)
            journal: dict[str, Sequence[JournalEvent]] = {}
            if simulated:
                journal[TRUTH] = [event for event in own if event.source == "auto"]
            for rater, events in raters.items():
                if saw_whole(events, start.trial, start.attempt):
                    journal[rater] = counting(events, start.trial, start.attempt)
            if arm := [event for event in own if event.source == ARM]:
                journal[ARM] = arm
            if pressed:
                journal[EXPERIMENTER] = [event for event in own if event.source == EXPERIMENTER]
            key, length_s = (person, start.trial, start.attempt), (end.t_ns - start.t_ns) / 1e9
            for name, seen in journal.items():
                times: dict[str, list[float]] = {kind: [] for kind in (*SEEN, *plan.settings.behaviours)}
                for event in sorted(seen, key=lambda one: one.t_ns):
                    kind = event.item if event.kind == "behaviour" else event.kind
                    if kind in times:  # a late press belongs to the trial, and within it
                        times[kind].append(min(max((event.t_ns - start.t_ns) / 1e9, 0.0), length_s))
                blind = frozenset(event.item for event in seen if event.text == NOT_OBSERVABLE)
                accounts.setdefault(name, []).append(Scored(key, length_s, times, blind))
    return accounts


def agreements(folder: Path, *, tolerance_s: float = TOLERANCE_S) -> list[Agreement]:
    """Compare every two accounts over the trials that both have, for each kind of event that either has.

    A rater who was shown proposals is compared with other people alone.
    """
    accounts = scored_trials(folder)
    plan = read_plan(folder)
    own = plan.settings.behaviours
    everybody = [read_observers(folder, person) for person in staying(folder, plan)]
    displayed = {rater for raters in everybody for rater, events in raters.items() if saw_proposals(events)}
    names = sorted(accounts, key=lambda name: (_PLACES.get(name, 1), name))
    found = []
    for a, b in combinations(names, 2):
        if {a, b} & displayed and {a, b} & {TRUTH, DETECTOR}:
            continue  # what rule and detector proposed would be compared with itself
        first = {one.key: one for one in accounts[a]}
        second = {one.key: one for one in accounts[b]}
        both = [key for key in first if key in second]
        for kind in (*SEEN, *own):
            if kind in own and not {a, b}.isdisjoint(_PLACES):
                continue  # only raters look for the behaviours that the plan names
            if any(kind in _NEVER.get(name, ()) for name in (a, b)):
                continue
            if kind == "placed" and {name.partition("+")[0] for name in (a, b)} != {CAMERA}:
                continue  # who does not go by the camera does not look for it
            able = [key for key in both if kind not in first[key].unobservable | second[key].unobservable]
            times_a = [first[key].times_s[kind] for key in able]
            times_b = [second[key].times_s[kind] for key in able]
            seen = any(second[key].times_s[kind] or first[key].times_s[kind] for key in both)
            blind = seen and not able
            if any(times_a) or any(times_b) or blind:
                lengths_s = [first[key].length_s for key in able]
                one = agreement(kind, (a, b), times_a, times_b, lengths_s, tolerance_s=tolerance_s)
                note = f"{DETECTOR}: {NOT_OBSERVABLE}" if blind else ""
                if not blind and not one.matched:
                    without = [name for name, n in ((a, one.n_a), (b, one.n_b)) if not n]
                    note = f"no event of {without[0]}" if without else ""
                    note = note or f"none within {tolerance_s:g} s of the other's"
                found.append(msgspec.structs.replace(one, note=note))
    return found
