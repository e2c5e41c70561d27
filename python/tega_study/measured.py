"""Read a scene camera's measurements of a session's trials: an account beside the raters' own.

The camera's events are ``measured.jsonl`` beside the session's, found by rule, overwritten by each measurement. A
rater confirms a trial or corrects it; that account is a rater's separate file, ``observers/camera+ID.jsonl``, and
counts as a rater's does. The camera's account stays unchanged, so ``study score`` can compute how far both agree.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tega_study.journal import JournalEvent, events_path, read_events

CAMERA = "camera"


def measured_path(folder: Path, participant: str) -> Path:
    """Return where the camera's events of a session are."""
    return events_path(folder, participant).with_name("measured.jsonl")


def read_measured(folder: Path, participant: str) -> list[JournalEvent]:
    """Read the camera's events of a session; none before ``scene measure``."""
    return read_events(measured_path(folder, participant))


def camera_success(events: Sequence[JournalEvent], *, dropped: bool) -> bool:
    """Return whether a trial succeeded by the camera's events, with the drops as a person has corrected them.

    ``dropped``: whether a drop counts.
    """
    end = next(event for event in events if event.kind == "trial_end")
    struck = not dropped and any(event.kind == "drop" for event in events)
    # The camera's verdict without the drop: it writes "lifted" only for a lift in time.
    return not dropped and (bool(end.success) or (struck and any(e.kind == "lifted" for e in events)))
