"""Keep what is noted beside a plan: who has withdrawn, and who compared conditions before it was complete."""

from __future__ import annotations

import logging
import os
import re
import time
from datetime import UTC, datetime
from pathlib import Path

from tega.errors import RecordingError
from tega.runtime.files.foreign_file import read_words
from tega_study.journal import Journal, events_path, read_events
from tega_study.plan import StudyPlan

_LOG = logging.getLogger(__name__)

WITHDRAWN = "withdrawn.txt"


def withdrawn_ids(folder: Path) -> set[str]:
    """Return the ids of those who have withdrawn; nothing is deleted by asking."""
    path = folder / WITHDRAWN
    if not path.exists():
        return set()
    ids = {line for line in lines_of(path) if re.fullmatch(r"p\d+", line)}
    for person in sorted(ids):
        if os.path.lexists(events_path(folder, person).parent):
            _LOG.warning(
                "%s has withdrawn, but something of theirs is left: tega-teleop study withdraw %s %s",
                person,
                folder,
                person,
            )
    return ids


def check_stays(folder: Path, participant: str) -> None:
    """Raise ``RecordingError`` for a participant who has withdrawn."""
    if participant in withdrawn_ids(folder):
        raise RecordingError(f"{participant} has withdrawn", "go on with another participant")


def staying(folder: Path, plan: StudyPlan) -> list[str]:
    """Return the IDs of a plan's participants who have not withdrawn, in the plan's order."""
    gone = withdrawn_ids(folder)
    return [person for person in plan.participants if person not in gone]


def lines_of(path: Path) -> list[str]:
    """Return the lines of a list; ``RecordingError`` if it is no text."""
    try:
        return read_words(path).splitlines()
    except UnicodeDecodeError as error:
        raise RecordingError(f"{path}: no list of lines: {error}", "restore it from a copy") from error


JOURNAL = "journal.jsonl"
"""The study's own journal, beside its plan; sessions have theirs."""


def note_unblinding(folder: Path, text: str) -> None:
    """Write into the study's journal that its conditions are compared now."""
    with Journal(folder / JOURNAL) as journal:
        journal.add("unblind", t_ns=time.time_ns(), source="auto", text=text)


def unblindings(folder: Path) -> tuple[str, ...]:
    """Return when the study was unblinded before its plan was complete, and how far it was, one text each.

    An anonymised copy has no dates.
    """
    found = []
    for event in read_events(folder / JOURNAL):
        if event.kind == "unblind":
            day = datetime.fromtimestamp(event.t_ns / 1e9, UTC).date().isoformat()
            found.append(f"{day}: {event.text}" if event.t_ns else event.text)
    return tuple(found)


def copy_unblindings(folder: Path, out: Path) -> None:
    """Copy them into an anonymised copy of the study, without dates."""
    texts = [event.text for event in read_events(folder / JOURNAL) if event.kind == "unblind"]
    if texts:
        with Journal(out / JOURNAL) as journal:
            for text in texts:
                journal.add("unblind", t_ns=0, source="auto", text=text)
