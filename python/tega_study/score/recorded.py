"""List a person's recorded trials that count, and those without a usable recording."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import msgspec

from tega.errors import RecordingError
from tega.runtime.files.foreign_file import parse_json, read_foreign
from tega_study.journal import attempts, events_path, read_events
from tega_study.lead.trial import recording_folder
from tega_study.plan import read_plan


class RecordedTrial(NamedTuple):
    """A trial with a recording, without its condition.

    Attributes:
        id: Such as ``p01-t07``.
        trial: Its number in the plan, which is hidden from raters.
        start_ns: On the session's clock.
        zero_ns: The trial's start, counted from the recording's.
    """

    id: str
    trial: int
    attempt: int
    object: str
    start_ns: int
    length_ns: int
    zero_ns: int
    folder: Path


class _Facts(msgspec.Struct):
    """Content of ``trial.json`` that is used."""

    trial: str
    attempt: int
    zero_ns: int
    started_ns: int


def recorded_trials(folder: Path, participant: str) -> tuple[list[RecordedTrial], list[str]]:
    """Return a person's recorded trials that count, in the plan's order.

    Also the reasons why others have no usable recording, as far as known without reading it.
    """
    events = read_events(events_path(folder, participant))
    ended = {start.trial: (start, end) for start, end in attempts(events, with_data=True)}
    found: list[RecordedTrial] = []
    unseen: list[str] = []
    for trial in sorted(read_plan(folder).of(participant), key=lambda one: one.trial):
        if trial.trial not in ended:
            continue
        start, end = ended[trial.trial]
        where = recording_folder(folder, trial, start.attempt)
        try:
            zero_ns = _begins(where, trial.id, start.attempt, start.t_ns)
        except RecordingError as error:
            unseen.append(f"{trial.id}: {error.message}")
            continue
        length_ns = max(end.t_ns - start.t_ns, 1)
        found.append(
            RecordedTrial(
                trial.id, trial.trial, start.attempt, trial.object, start.t_ns, length_ns, zero_ns, where
            )
        )
    return found, unseen


def _begins(where: Path, trial_id: str, attempt: int, start_ns: int) -> int:
    """Return where in its recording a trial begins, nanoseconds."""
    if not (path := where / "trial.json").exists():
        raise RecordingError("no recording" if not where.exists() else "trial.json is missing")
    try:
        facts = parse_json(read_foreign(path, most_mib=1), _Facts)
    except (msgspec.DecodeError, OSError) as error:
        raise RecordingError(f"trial.json is damaged: {error}") from error
    if (facts.trial, facts.attempt) != (trial_id, attempt):
        raise RecordingError(f"the recording is of another trial, {facts.trial} attempt {facts.attempt}")
    if facts.started_ns != start_ns:
        raise RecordingError("the recording is of another session, begun at another time")
    if not any(where.glob("*.mcap")) and not (where / "truth.csv").exists():
        unfinished = any(where.glob("*.part"))
        raise RecordingError("the recording was never finished" if unfinished else "no recording")
    return start_ns - facts.zero_ns
