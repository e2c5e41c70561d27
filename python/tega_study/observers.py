"""Read the accounts of a session beside its own events: the raters' files, and a scene camera's measurements.

A rater confirms or corrects the camera's in a separate file, ``observers/camera+ID.jsonl``.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tega.errors import InvalidValueError
from tega.runtime.files.foreign_file import plain_name
from tega_study.journal import JournalEvent, events_path, read_events

WHOLE, PART = "", "not the whole trial"
"""Texts of a rater's ``trial_end``."""

RECORDED = "recorded"
"""Item of the ``session_start`` of a rater who scores recordings."""

PROPOSED = "proposed"
"""Item of the ``session_start`` of a rater who was shown what rule and detector say."""


def observer_path(folder: Path, participant: str, rater: str) -> Path:
    """Return where a rater's events of a session are."""
    plain_name(rater, subject="rater", source=folder.name)
    return events_path(folder, participant).parent / "observers" / f"{rater}.jsonl"


def check_new(folder: Path, participant: str, rater: str) -> None:
    """Raise ``InvalidValueError`` for a rater who has a file of a session."""
    if observer_path(folder, participant, rater).exists():
        raise InvalidValueError(f"{rater} has scored {participant} already", "give another --rater")


def read_observers(folder: Path, participant: str) -> dict[str, list[JournalEvent]]:
    """Read every rater's events of a session, by rater in the order of their names.

    Raters who confirmed a camera's measurement (``camera+ID``) come after those who watched the trials.
    """
    folder_of = events_path(folder, participant).parent / "observers"
    found = sorted(folder_of.glob("*.jsonl"), key=lambda path: ("+" in path.stem, path.name))
    return {path.stem: read_events(path) for path in found}


def saw_whole(events: Sequence[JournalEvent], trial: int, attempt: int) -> bool:
    """Return whether a rater saw a trial from its start to its end."""
    return any(
        e.kind == "trial_end" and (e.trial, e.attempt) == (trial, attempt) and e.text == WHOLE for e in events
    )


def saw_proposals(events: Sequence[JournalEvent]) -> bool:
    """Return whether a rater saw proposals of rule and detector, which raises the agreement with them."""
    return any(e.kind == "session_start" and e.item == PROPOSED for e in events)


CAMERA = "camera"


def measured_path(folder: Path, participant: str) -> Path:
    """Return where the camera's events of a session are."""
    return events_path(folder, participant).with_name("measured.jsonl")


def read_measured(folder: Path, participant: str) -> list[JournalEvent]:
    """Read the camera's events of a session; none before ``scene measure``."""
    return read_events(measured_path(folder, participant))
