"""Export trials to BORIS and import events coded there: an observation for each trial and rater.

Format "7.0", as its source has it. The condition is left out: who codes must not know it. Columns of a tabular export
are found by their names, since they differ between versions.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from tega.errors import InvalidValueError, RecordingError
from tega.runtime.files.foreign_file import read_words
from tega_study.detecting import DETECTOR, read_detected
from tega_study.journal import Journal, JournalEvent, Kind, counting, events_path, read_events
from tega_study.observers import PART, WHOLE, observer_path, read_observers
from tega_study.plan import read_plan
from tega_study.privacy import note_elsewhere
from tega_study.score.boris_file import (
    BorisBehaviour,
    CodedEvent,
    boris_observation,
    boris_project,
    read_boris,
)

CODES: dict[str, tuple[Kind, str]] = {
    "slip": ("slip", "s"),
    "deformation": ("deformation", "d"),
    "drop": ("drop", "x"),
    "lift_off": ("lift_off", "l"),
}
"""Behaviours of a project: the kind of event each is, and its key."""
_ID = re.compile(r"(p\d+)_t(\d+)_a([12])(?:_(.+))?")


def export_boris(folder: Path, path: Path) -> int:
    """Write a project: an observation for each trial and rater, and one to fill in where nobody has scored.

    Args:
        folder: The study's folder.
        path: The ``.boris`` file; must not exist.

    Returns:
        How many observations.

    Raises:
        InvalidValueError: The file is there already.
    """
    if path.exists():
        raise InvalidValueError(f"{path}: is there already", "name a new file")
    plan = read_plan(folder)
    observations: dict[str, Any] = {}
    for person in plan.participants:
        main = read_events(events_path(folder, person))
        accounts = read_observers(folder, person) or {"": []}
        if detected := read_detected(folder, person):
            accounts[DETECTOR] = detected
        mine = {trial.trial: trial for trial in plan.of(person)}
        for start, end in attempts(main):
            trial = mine[start.trial]
            stem = f"{person}_t{trial.trial:02d}_a{start.attempt}"
            for rater, events in accounts.items():
                found = [
                    CodedEvent((e.t_ns - start.t_ns) / 1e9, "", e.kind)
                    for e in counting(events, trial.trial, start.attempt)
                    if e.kind in CODES
                ]
                observations[f"{stem}_{rater}" if rater else stem] = boris_observation(
                    found,
                    length_s=(end.t_ns - start.t_ns) / 1e9,
                    variables={"participant": person, "trial": str(trial.trial), "object": trial.object},
                )
    project = boris_project(
        name=folder.name,
        description="trials of a study; times count from each trial's start",
        behaviours=[BorisBehaviour(code, key) for code, (_kind, key) in CODES.items()],
        variables=("participant", "trial", "object"),
        observations=observations,
    )
    path.write_bytes(project)
    for person in dict.fromkeys(name.partition("_")[0] for name in observations):
        note_elsewhere(folder, person, path)
    return len(observations)


def import_boris(folder: Path, path: Path, rater: str) -> dict[str, int]:
    """Take in events coded in BORIS as those of a new rater.

    Args:
        folder: The study's folder.
        path: A project (``.boris``), or a tabular export as TSV or CSV. Observations are named as
            :func:`export_boris` names them. Of several of a trial the one that ends in the rater's code is taken,
            else the one that ends in none, and the detector's only where there is no other.
        rater: A code that nobody has used in these sessions.

    Returns:
        Number of trials taken in, by person.

    Raises:
        RecordingError: The file cannot be read, or an observation or behaviour is not one of the study's.
        InvalidValueError: The rater has a file already.
    """
    if path.suffix == ".boris":
        observed: dict[str, Sequence[tuple[float, str]]] = {
            name: [(e.t_s, e.code) for e in events] for name, events in read_boris(path).items()
        }
    else:
        observed = dict(_table(path))
    plan = read_plan(folder)
    signed = plan.settings.plan_sha256
    by_person: dict[str, dict[tuple[int, int], dict[str, Sequence[tuple[float, str]]]]] = {}
    for name, coded in observed.items():
        found = _ID.fullmatch(name)
        if found is None:
            raise RecordingError(f"{path.name}: observation {name!r} names no trial", "name it as p01_t07_a1")
        key, whose = (int(found[2]), int(found[3])), found[4] or ""
        by_person.setdefault(found[1], {}).setdefault(key, {})[whose] = coded
    ready: dict[str, list[tuple[JournalEvent, JournalEvent, Sequence[tuple[float, str]]]]] = {}
    for person, trials in by_person.items():
        plan.of(person)
        if observer_path(folder, person, rater).exists():
            raise InvalidValueError(f"{rater} has scored {person} already", "give another --rater")
        ran = {(s.trial, s.attempt): (s, e) for s, e in attempts(read_events(events_path(folder, person)))}
        for key, accounts in trials.items():
            if key not in ran:
                raise RecordingError(f"{path.name}: trial {key[0]} of {person} was not run")
            coded = _of_one(path, f"{person}_t{key[0]:02d}_a{key[1]}", accounts, rater)
            for _t_s, code in coded:
                if code not in CODES:
                    raise RecordingError(
                        f"{path.name}: behaviour {code!r} is not known", f"use {', '.join(CODES)}"
                    )
            ready.setdefault(person, []).append((*ran[key], coded))
    for person, rows in ready.items():
        write_coded(
            folder, person, rater, [CodedTrial(start, end, coded) for start, end, coded in rows], signed
        )
    return {person: len(rows) for person, rows in ready.items()}


class CodedTrial(NamedTuple):
    """Trial as a rater coded it.

    Attributes:
        start: Of the attempt.
        end: Likewise.
        events: Seconds from its start, and behaviours of :data:`CODES`.
        whole: Whether all of it was coded.
    """

    start: JournalEvent
    end: JournalEvent
    events: Sequence[tuple[float, str]]
    whole: bool = True


def write_coded(
    folder: Path, person: str, rater: str, trials: Sequence[CodedTrial], signed: str, *, item: str = ""
) -> None:
    """Write what a rater coded of a session into a new file of theirs.

    Args:
        folder: The study's folder.
        person: Whose session.
        rater: Who coded; without a file in this session.
        trials: What was coded.
        signed: Fingerprint of the plan.
        item: How it was coded (:mod:`tega_study.observers`).
    """
    with Journal(observer_path(folder, person, rater)) as journal:
        first_ns = min(one.start.t_ns for one in trials)
        journal.add("session_start", t_ns=first_ns, source=rater, text=signed, item=item)
        for start, end, coded, whole in trials:
            trial, attempt = start.trial, start.attempt
            journal.add("trial_start", t_ns=start.t_ns, trial=trial, attempt=attempt, source=rater)
            for t_s, code in coded:
                at_ns = start.t_ns + round(t_s * 1e9)
                journal.add(CODES[code][0], t_ns=at_ns, trial=trial, attempt=attempt, source=rater)
            text = WHOLE if whole else PART
            journal.add("trial_end", t_ns=end.t_ns, trial=trial, attempt=attempt, source=rater, text=text)


def attempts(events: Sequence[JournalEvent]) -> list[tuple[JournalEvent, JournalEvent]]:
    """Return start and end of every attempt that was made, in their order."""
    starts = {(e.trial, e.attempt): e for e in events if e.kind == "trial_start"}
    return [
        (starts[e.trial, e.attempt], e)
        for e in events
        if e.kind == "trial_end" and (e.trial, e.attempt) in starts
    ]


def _of_one(
    path: Path, name: str, accounts: dict[str, Sequence[tuple[float, str]]], rater: str
) -> Sequence[tuple[float, str]]:
    """Return what the rater coded: under that name, else under none, else what there is."""
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


def _table(path: Path) -> dict[str, list[tuple[float, str]]]:
    try:
        text = read_words(path, most_mib=64)
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"{path}: cannot be read: {error}") from error
    if "\0" in text:
        raise RecordingError(f"{path}: is no table of text", "export tabular events from BORIS")
    rows = csv.DictReader(text.splitlines(), delimiter="\t" if "\t" in text.partition("\n")[0] else ",")
    needed = {"Observation id", "Behavior", "Time"}
    if missing := needed - set(rows.fieldnames or ()):
        raise RecordingError(
            f"{path.name}: has no column {', '.join(sorted(missing))}", "export tabular events from BORIS"
        )
    observed: dict[str, list[tuple[float, str]]] = {}
    for row in rows:
        try:
            observed.setdefault(row["Observation id"], []).append((float(row["Time"]), row["Behavior"]))
        except (TypeError, ValueError) as error:
            raise RecordingError(f"{path.name}: line {rows.line_num}: {error}", "export it again") from error
    return observed
