"""Export trials to BORIS and ELAN, and import events coded there: an observation for each trial and rater.

The condition is left out: a rater must not know it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from tega.errors import InvalidValueError, RecordingError
from tega.runtime.files.annotations import CodedEvent, check_times, known_code
from tega.runtime.files.boris import BorisBehaviour, boris_observation, boris_project, read_boris
from tega.runtime.files.eaf import read_eaf, write_eaf
from tega_study.detecting import DETECTOR, read_detected
from tega_study.journal import CODES, Journal, JournalEvent, attempts, counting, events_path, read_events
from tega_study.observers import PART, WHOLE, check_new, observer_path, read_observers
from tega_study.plan import StudyPlan, read_plan
from tega_study.privacy import note_elsewhere

_ID = re.compile(r"(p\d+)_t(\d+)_a([12])(?:_(.+))?")


def export_boris(folder: Path, path: Path) -> int:
    """Write a project: an observation for each trial and rater, and an empty one for each unscored trial.

    Returns how many observations; ``path`` must not exist.
    """
    if path.exists():
        raise InvalidValueError(f"{path}: is there already", "name a new file")
    plan = read_plan(folder)
    accounts = list(_accounts(folder, plan))
    states = sorted({event.code for one in accounts for event in one.events if event.duration_s})
    project = boris_project(
        name=folder.name,
        description="trials of a study; times count from each trial's start",
        behaviours=[BorisBehaviour(c, key, is_state=c in states) for c, key in _behaviours(plan).items()],
        variables=("participant", "trial", "object"),
        observations={
            f"{one.stem}_{one.rater}" if one.rater else one.stem: boris_observation(
                one.events, length_s=one.length_s, variables=one.variables, states=states
            )
            for one in accounts
        },
    )
    path.write_bytes(project)
    for person in dict.fromkeys(one.variables["participant"] for one in accounts):
        note_elsewhere(folder, person, path)
    return len(accounts)


def export_elan(folder: Path, out: Path) -> int:
    """Write an ELAN file for each trial, ``p01_t07_a1.eaf``, with a tier for each rater and behaviour.

    ``out`` must be new or empty. Returns how many files.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InvalidValueError(f"{out}: is there already", "name a new folder")
    out.mkdir(parents=True, exist_ok=True)
    plan = read_plan(folder)
    trials: dict[str, dict[str, list[CodedEvent]]] = {}
    for one in _accounts(folder, plan):
        trials.setdefault(one.stem, {})[one.rater] = one.events
        note_elsewhere(folder, one.variables["participant"], out)
    for stem, raters in trials.items():
        write_eaf(out / f"{stem}.eaf", raters, codes=list(_behaviours(plan)))
    return len(trials)


class _Account(NamedTuple):
    """Events of a trial as one rater coded them; an uncoded trial has no rater."""

    stem: str
    rater: str
    events: list[CodedEvent]
    length_s: float
    variables: dict[str, str]


def _accounts(folder: Path, plan: StudyPlan) -> Iterator[_Account]:
    for person in plan.participants:
        raters = read_observers(folder, person) or {"": []}
        if detected := read_detected(folder, person):
            raters[DETECTOR] = detected
        mine = {trial.trial: trial for trial in plan.of(person)}
        for start, end in ended_attempts(folder, person).values():
            trial = mine[start.trial]
            variables = {"participant": person, "trial": str(trial.trial), "object": trial.object}
            for rater, events in raters.items():
                found = [
                    CodedEvent(
                        (e.t_ns - start.t_ns) / 1e9, "", code, e.modifiers, e.text, e.duration_s or 0.0
                    )
                    for e in counting(events, trial.trial, start.attempt)
                    if (code := e.item if e.kind == "behaviour" else e.kind if e.kind in CODES else "")
                ]
                stem, length_s = (
                    f"{person}_t{trial.trial:02d}_a{start.attempt}",
                    (end.t_ns - start.t_ns) / 1e9,
                )
                yield _Account(stem, rater, found, length_s, variables)


def _behaviours(plan: StudyPlan) -> dict[str, str]:
    """Return the behaviours of a study, each with its key."""
    free = [key for key in "123456789abcefghijkmnopqrtuvwyz" if key not in CODES.values()]
    return CODES | dict(zip(plan.settings.behaviours, free, strict=False))


def import_boris(folder: Path, path: Path, rater: str) -> dict[str, int]:
    """Take in events coded in BORIS or ELAN as those of a new rater; return the number of trials by person.

    ``path`` is a BORIS project, a tabular or aggregated export as TSV or CSV, or an ELAN file or a folder of
    them. Observations are named as :func:`export_boris` names them. Of several of a trial the one that ends in
    the rater's code is taken, else the one that ends in none, and the detector's only where there is no other.
    ``InvalidValueError`` if the rater has scored these sessions, ``RecordingError`` if observations or
    behaviours are not the study's, or events outside of their trial.
    """
    plan = read_plan(folder)
    signed, known = plan.settings.plan_sha256, list(_behaviours(plan))
    by_person: dict[str, dict[tuple[int, int], dict[str, Sequence[CodedEvent]]]] = {}
    for name, coded in _observed(path, known).items():
        found = _ID.fullmatch(name)
        if found is None:
            raise RecordingError(f"{path.name}: observation {name!r} names no trial", "name it as p01_t07_a1")
        key, whose = (int(found[2]), int(found[3])), found[4] or ""
        by_person.setdefault(found[1], {}).setdefault(key, {})[whose] = coded
    ready: dict[str, list[CodedTrial]] = {}
    for person, trials in by_person.items():
        plan.of(person)
        check_new(folder, person, rater)
        ran = ended_attempts(folder, person)
        for key, accounts in trials.items():
            if key not in ran:
                raise RecordingError(f"{path.name}: trial {key[0]} of {person} was not run")
            name = f"{person}_t{key[0]:02d}_a{key[1]}"
            start, end = ran[key]
            coded = check_times(
                _of_one(path, name, accounts, rater),
                length_s=(end.t_ns - start.t_ns) / 1e9,
                name=f"{path.name}: {name}",
                hint="code each trial in an observation of its own, with times from the trial's start",
            )
            ready.setdefault(person, []).append(CodedTrial(start, end, _named(path, coded, known)))
    for person, rows in ready.items():
        write_coded(folder, person, rater, rows, signed)
    return {person: len(rows) for person, rows in ready.items()}


def _observed(path: Path, known: Sequence[str]) -> dict[str, list[CodedEvent]]:
    files = sorted(path.glob("*.eaf")) if path.is_dir() else [path] if path.suffix.lower() == ".eaf" else []
    if not files:
        return read_boris(path)
    observed: dict[str, list[CodedEvent]] = {}
    for file in files:
        for rater, events in read_eaf(file, known).items():
            observed[f"{file.stem}_{rater}" if rater else file.stem] = events
    return observed


def _named(path: Path, events: Sequence[CodedEvent], known: Sequence[str]) -> list[CodedEvent]:
    """Return events with the names that the study has for their behaviours."""
    named = []
    for event in events:
        code = known_code(event.code, known)
        if code is None:
            raise RecordingError(
                f"{path.name}: behaviour {event.code!r} is not known",
                f"use {', '.join(known)}, or plan the study with --behaviours {event.code}",
            )
        named.append(event._replace(code=code))
    return named


def ended_attempts(folder: Path, person: str) -> dict[tuple[int, int], tuple[JournalEvent, JournalEvent]]:
    """Return start and end of every attempt of a session that has ended, by trial and attempt."""
    return {(s.trial, s.attempt): (s, e) for s, e in attempts(read_events(events_path(folder, person)))}


class CodedTrial(NamedTuple):
    """Trial as a rater coded it, ``whole`` or in part; its behaviours are of :data:`CODES` or of the plan."""

    start: JournalEvent
    end: JournalEvent
    events: Sequence[CodedEvent]
    whole: bool = True


def write_coded(
    folder: Path, person: str, rater: str, trials: Sequence[CodedTrial], signed: str, *, item: str = ""
) -> None:
    """Write a rater's coded events of a session into the rater's new file."""
    with Journal(observer_path(folder, person, rater)) as journal:
        first_ns = min(one.start.t_ns for one in trials)
        journal.add("session_start", t_ns=first_ns, source=rater, text=signed, item=item)
        for start, end, coded, whole in trials:
            rows = [
                {
                    "kind": event.code if event.code in CODES else "behaviour",
                    "t_ns": start.t_ns + round(event.t_s * 1e9),
                    "text": event.comment,
                    "item": "" if event.code in CODES else event.code,
                    "duration_s": event.duration_s or None,
                    "modifiers": event.modifiers,
                }
                for event in coded
            ]
            journal.add_attempt((start, end), rater, rows, text=WHOLE if whole else PART)


def _of_one(
    path: Path, name: str, accounts: dict[str, Sequence[CodedEvent]], rater: str
) -> Sequence[CodedEvent]:
    """Return the rater's observation: under that name, else without a name, else the one there is."""
    for whose in (rater, ""):
        if whose in accounts:
            return accounts[whose]
    people = [coded for whose, coded in accounts.items() if whose != DETECTOR]
    if len(people) > 1:
        raise RecordingError(
            f"{path.name}: two observations of {name}, none of them {name}_{rater}",
            "name the rater's so, or leave those of one rater in the file",
        )
    return next(iter(people or accounts.values()))
