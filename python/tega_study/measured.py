"""Read what a scene camera measured of a session's trials: an account beside the raters' own.

The camera's events are ``measured.jsonl`` beside the session's, by rule, written anew by each measurement. Who looks at
them confirms a trial or corrects it; that account is a rater's file of its own, ``observers/camera+ID.jsonl``, and
counts as a rater's does. The camera's stays as it was, so that ``study score`` can say how far both agree.
"""

from __future__ import annotations

from pathlib import Path

from tega_study.journal import JournalEvent, events_path, read_events

CAMERA = "camera"


def measured_path(folder: Path, participant: str) -> Path:
    """Return where the camera's events of a session are."""
    return events_path(folder, participant).with_name("measured.jsonl")


def read_measured(folder: Path, participant: str) -> list[JournalEvent]:
    """Read the camera's events of a session; none before ``scene measure``."""
    return read_events(measured_path(folder, participant))
