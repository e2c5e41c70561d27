"""Withdrawal, and the anonymised copy.

Everything about one person lies in folders that bear the person's id (``sessions/p03``, ``courses/p03``, ...),
so that it can be deleted whole. Muscle signals can identify a person: the anonymised copy has none, nor texts,
names or dates.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

import msgspec

from tega.errors import InvalidValueError, RecordingError
from tega.study.journal import Event, Journal, read_events
from tega.study.observers import PART, observer_path, read_observers
from tega.study.plan import StudyPlan, person_id, read_plan, write_plan
from tega.study.state import events_path

__all__ = ["export", "withdraw", "withdrawn"]

_LIST = "withdrawn.txt"
REPORTS = ("report", "report.html")
COURSES = "courses"
ROLES = ("auto", "experimenter", "participant")
"""Sources of events that name nobody."""


def withdrawn(folder: Path) -> set[str]:
    """Return the ids of those who have withdrawn, and finish a deletion that was cut short.

    Args:
        folder: The study's folder.
    """
    path = folder / _LIST
    if not path.exists():
        return set()
    ids = {line for line in path.read_text(encoding="utf-8").splitlines() if re.fullmatch(r"p\d+", line)}
    for person in ids:
        _delete(folder, person)
    return ids


def withdraw(folder: Path, participant: str) -> list[Path]:
    """Delete what there is of a person, and the reports that it went into. It cannot be undone.

    The id stays in the plan and in ``withdrawn.txt``, so that the study's flow can be told. Copies made elsewhere, and
    the disk's own (journals, snapshots, worn flash cells), are not reached.

    Args:
        folder: The study's folder.
        participant: Whose data.

    Returns:
        What was deleted.

    Raises:
        InvalidValueError: Nobody in the plan has that id.
        DeviceUnavailableError: The session is open in another program.
    """
    read_plan(folder).of(participant)
    if participant in withdrawn(folder):
        return []
    own = [events_path(folder, participant)]
    raters = [observer_path(folder, participant, rater) for rater in read_observers(folder, participant)]
    for path in (*own, *raters):
        if path.exists():
            Journal(path).close()  # refuses while a console has it open
    with (folder / _LIST).open("a", encoding="utf-8") as file:  # before anything goes: a crash cannot undo it
        file.write(f"\n{participant}\n")
        file.flush()
        os.fsync(file.fileno())
    return _delete(folder, participant)


def _delete(folder: Path, participant: str) -> list[Path]:
    found = sorted(path for path in folder.glob(f"*/{participant}") if path.is_dir())
    if found:
        found += [folder / name for name in REPORTS if (folder / name).exists()]
    for path in found:
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()
    return found


def export(folder: Path, out: Path, *, key: str) -> dict[str, str]:
    """Write an anonymised copy of a study, fit to be published and to make the report from.

    It has plan, events and courses of touch and level under new ids in a new order; no muscle signals, pictures, texts
    or raters' names; times count from each session's first event; the seed, from which the old ids could be worked
    out, is left out.

    Args:
        folder: The study's folder.
        out: Must not exist, or be empty.
        key: Decides the new ids; keep it secret or throw it away.

    Returns:
        The new id of each old one; not written anywhere.

    Raises:
        InvalidValueError: ``out`` is there already, or ``key`` is empty.
        RecordingError: The study is damaged.
    """
    from tega.study.silico.assumptions import PARAMETERS, SIMULATION

    if not key:
        raise InvalidValueError("key is empty", "give a long random word")
    plan, gone = read_plan(folder), withdrawn(folder)

    def rank(person: str) -> str:
        return hashlib.sha256(f"tega-export|{key}|{person}".encode()).hexdigest()

    stay = [person for person in sorted(plan.participants, key=rank) if person not in gone]
    if not stay:
        raise RecordingError(f"{folder}: everybody has withdrawn", "there is nothing to export")
    new = {person: person_id(number) for number, person in enumerate(stay, start=1)}
    trials = tuple(
        msgspec.structs.replace(trial, participant=new[person])
        for person in stay
        for trial in plan.of(person)
    )
    settings = msgspec.structs.replace(plan.settings, seed=None)
    assumed = [folder / name for name in (SIMULATION, PARAMETERS)]
    write_plan(
        StudyPlan(settings, trials), out, {path.name: path.read_bytes() for path in assumed if path.exists()}
    )
    signed = read_plan(out).settings.plan_sha256
    observers = {old: read_observers(folder, old) for old in new}
    sessions = {old: read_events(events_path(folder, old)) for old in new}
    everything = [*sessions.values(), *(seen for one in observers.values() for seen in one.values())]
    sources = {event.source for events in everything for event in events} | {
        r for o in observers.values() for r in o
    }
    raters = {name: f"r{n}" for n, name in enumerate(sorted(sources - {"", *ROLES}, key=rank), start=1)}
    for old, person in new.items():
        begin_ns = sessions[old][0].t_ns if sessions[old] else 0
        _copy_events(sessions[old], events_path(out, person), signed, begin_ns, raters)
        for rater, seen in observers[old].items():
            _copy_events(seen, observer_path(out, person, raters[rater]), signed, begin_ns, raters)
        for course in sorted((folder / COURSES / old).glob("*.csv")):
            target = out / COURSES / person / course.name.replace(old, person, 1)  # p03-t07 bears the old id
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(course, target)
    return new


def _copy_events(
    events: Sequence[Event], target: Path, signed: str, begin_ns: int, raters: Mapping[str, str]
) -> None:
    if not events:
        return

    def plain(event: Event) -> Event:
        text = signed if event.kind == "session_start" else ""
        if event.kind == "trial_end" and event.text == PART:  # decides whose counts are used
            text = PART
        return msgspec.structs.replace(
            event, t_ns=event.t_ns - begin_ns, source=raters.get(event.source, event.source), text=text
        )

    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_bytes(b"".join(msgspec.json.encode(plain(event)) + b"\n" for event in events))
