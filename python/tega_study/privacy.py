"""Withdraw a person from a study by deleting their data, and write a study's anonymised copy.

Everything about one person is in files and folders that bear the person's ID (``sessions/p03``, ``courses/p03``,
...), so that it can be deleted whole. Files that the program made of the person elsewhere are listed beside the
session. Muscle signals can identify a person: the anonymised copy has none, nor texts, names or dates.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from tega.errors import InvalidValueError, RecordingError
from tega.recording.origin import NOTES
from tega.runtime.files.foreign_file import parse_json, read_foreign
from tega.runtime.files.whole_file import open_to_append, write_whole
from tega_study.journal import Journal, JournalEvent, events_path, read_events
from tega_study.observers import CAMERA, PART, measured_path, observer_path, read_measured, read_observers
from tega_study.plan import StudyPlan, person_id, read_plan, write_plan
from tega_study.study_notes import (
    OBJECTS,
    WITHDRAWN,
    copy_unblindings,
    objects_text,
    read_objects,
    staying,
    withdrawn_ids,
)

ELSEWHERE = NOTES
REPORTS = ("report", "report.html")
COURSES = "courses"
ROLES = ("auto", "arm", CAMERA, "experimenter", "participant")
"""Sources of events that identify no person."""


class Withdrawal(NamedTuple):
    """Files deleted, changed (BORIS projects) and left by a withdrawal.

    Those left are to be checked by hand: targets of links, files that the program made of the person elsewhere,
    and other people's files that bear the person's ID.
    """

    deleted: list[Path]
    changed: list[Path]
    left: list[Path]


def note_elsewhere(folder: Path, participant: str, path: Path) -> None:
    """Record a file that the program made of a person outside of the study's folder, for a withdrawal to list."""
    path, notes = path.absolute(), events_path(folder, participant).parent / ELSEWHERE
    if path.is_relative_to(folder.absolute()) or path in _copies(notes, set()):
        return
    notes.parent.mkdir(parents=True, exist_ok=True)
    with open_to_append(notes) as file:
        file.write(bytes(path) + b"\n")


def _copies(notes: Path, seen: set[Path]) -> list[Path]:
    """Return the copies that a list names and that are there, and the copies of those."""
    found: list[Path] = []
    for line in read_foreign(notes, most_mib=1).splitlines() if notes.is_file() else ():
        copy = Path(os.fsdecode(line))
        if copy not in seen and os.path.lexists(copy):
            seen.add(copy)
            found += [copy, *_copies(copy / ELSEWHERE, seen)]
    return found


def withdraw(folder: Path, participant: str) -> Withdrawal:
    """Delete what there is of a person, and the reports that it went into. It cannot be undone.

    The ID stays in the plan and in ``withdrawn.txt``, so that the study's flow can be reported. Links are
    deleted and not followed. Copies made elsewhere, and the disk's own (journals, snapshots, worn flash
    cells), are not reached. Call it again to finish an interrupted deletion. A session that another program
    has open is a ``DeviceUnavailableError``.
    """
    read_plan(folder).of(participant)
    if participant not in withdrawn_ids(folder):
        check_not_led(folder, participant)
        with open_to_append(folder / WITHDRAWN) as file:  # first: a crash cannot undo it
            file.write(f"\n{participant}\n".encode())
            file.flush()
            os.fsync(file.fileno())
    own = own_name(participant)
    mentioned = re.compile(rf"(?<![A-Za-z0-9]){re.escape(participant)}(?![A-Za-z0-9])")
    notes = events_path(folder, participant).parent / ELSEWHERE
    left = [] if notes.parent.is_symlink() else _copies(notes, set())
    deleted: list[Path] = []
    changed: list[Path] = []
    for where, folders, files in os.walk(folder):  # which follows no links
        for name in sorted([*folders, *files]):
            path = Path(where, name)
            if own.fullmatch(name):
                lists = (Path(one) / ELSEWHERE for one, _, beside in os.walk(path) if ELSEWHERE in beside)
                left += [copy for one in lists if not one.is_symlink() for copy in _copies(one, set())]
                left += [path.resolve()] if path.is_symlink() and path.exists() else []
                deleted.append(path)
            elif path.is_symlink() and (path / participant).exists():
                left.append((path / participant).resolve())
            elif path.suffix == ".boris" and path.is_file() and not path.is_symlink():
                changed += [path] if forget_person(path, participant) else []
            elif mentioned.search(name):
                left.append(path)
        folders[:] = [name for name in folders if not own.fullmatch(name)]
    if deleted:
        deleted += [folder / name for name in REPORTS if os.path.lexists(folder / name)]
    for path in deleted:
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink()
    return Withdrawal(deleted, changed, list(dict.fromkeys(left)))


def own_name(participant: str) -> re.Pattern[str]:
    """Return a pattern of the names of a person's files and folders, such as ``p03`` and ``p03-t07-a1``."""
    return re.compile(rf"{re.escape(participant)}([-_.].*)?")


def check_not_led(folder: Path, participant: str) -> None:
    """Raise ``DeviceUnavailableError`` while a program has the events of the person or a rater open."""
    own = [events_path(folder, participant)]
    raters = [observer_path(folder, participant, rater) for rater in read_observers(folder, participant)]
    for path in (*own, *raters):
        if path.exists() and not path.is_symlink():  # through a link nobody writes
            Journal(path).close()


def forget_person(path: Path, participant: str) -> bool:
    """Remove a person's observations from a BORIS project; return whether there were any."""
    try:
        tree = parse_json(read_foreign(path, most_mib=256), dict[str, Any])
        mine = [name for name in tree["observations"] if str(name).startswith(f"{participant}_")]
    except (OSError, msgspec.DecodeError, RecordingError, KeyError, TypeError):
        return False
    for name in mine:
        del tree["observations"][name]
    if mine:
        write_whole(path, msgspec.json.format(msgspec.json.encode(tree), indent=1) + b"\n", sync=True)
    return bool(mine)


def export(folder: Path, out: Path, *, key: str) -> dict[str, str]:
    """Write an anonymised copy of a study, fit to be published and to make the report from.

    The copy has the plan, the objects' properties, events and courses of touch and level under new IDs in a
    new order; no muscle signals, frames, photos, texts or raters' names. Times count from each session's
    first event. The seed is left out: the old IDs could be computed from it. ``key`` decides the new ids; keep
    it secret or throw it away. Returns the new id of each old one, which is not written anywhere.
    """
    from tega_study.silico.assumptions import PARAMETERS, SIMULATION

    if not key:
        raise InvalidValueError("key is empty", "give a long random word")
    plan = read_plan(folder)

    def rank(person: str) -> str:
        return hashlib.sha256(f"tega-export|{key}|{person}".encode()).hexdigest()

    stay = sorted(staying(folder, plan), key=rank)
    if not stay:
        raise RecordingError(f"{folder}: everybody has withdrawn", "there is nothing to export")
    new = {person: person_id(number) for number, person in enumerate(stay, start=1)}
    planned = [(person, trial) for person in stay for trial in plan.of(person)]
    trials = tuple(msgspec.structs.replace(trial, participant=new[person]) for person, trial in planned)
    settings = msgspec.structs.replace(plan.settings, seed=None)
    known = {name: msgspec.structs.replace(facts, photo="") for name, facts in read_objects(folder).items()}
    registry = {OBJECTS: objects_text(known).encode()} if known else {}
    assumed = [folder / name for name in (SIMULATION, PARAMETERS)]
    write_plan(
        StudyPlan(settings, trials),
        out,
        {path.name: read_foreign(path, most_mib=1) for path in assumed if path.exists()} | registry,
    )
    copy_unblindings(folder, out)
    signed = read_plan(out).settings.plan_sha256
    observers = {old: read_observers(folder, old) for old in new}
    sessions = {old: read_events(events_path(folder, old)) for old in new}
    everything = [*sessions.values(), *(seen for one in observers.values() for seen in one.values())]
    sources = {event.source for events in everything for event in events} | {
        r for o in observers.values() for r in o
    }
    raters = {
        name: f"{CAMERA}+" * name.startswith(f"{CAMERA}+") + f"r{n}"
        for n, name in enumerate(sorted(sources - {"", *ROLES}, key=rank), start=1)
    }
    for old, person in new.items():
        begin_ns = sessions[old][0].t_ns if sessions[old] else 0
        _copy_events(sessions[old], events_path(out, person), signed, begin_ns, raters)
        _copy_events(read_measured(folder, old), measured_path(out, person), signed, begin_ns, raters)
        for rater, seen in observers[old].items():
            _copy_events(seen, observer_path(out, person, raters[rater]), signed, begin_ns, raters)
        for course in sorted((folder / COURSES / old).glob("*.csv")):
            target = out / COURSES / person / course.name.replace(old, person, 1)  # p03-t07 bears the old id
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(read_foreign(course, most_mib=64))
    return new


def _copy_events(
    events: Sequence[JournalEvent], target: Path, signed: str, begin_ns: int, raters: Mapping[str, str]
) -> None:
    if not events:
        return

    def plain(event: JournalEvent) -> JournalEvent:
        text = signed if event.kind == "session_start" else ""
        if event.kind == "trial_end" and event.text == PART:  # decides whose counts are used
            text = PART
        value = None if event.kind in {"muscles", "squeeze"} else event.value
        return msgspec.structs.replace(
            event,
            value=value,
            t_ns=event.t_ns - begin_ns,
            source=raters.get(event.source, event.source),
            text=text,
        )

    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_bytes(b"".join(msgspec.json.encode(plain(event)) + b"\n" for event in events))
