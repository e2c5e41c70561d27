"""List a person's recorded trials for a rater: those that count, in an order that hides the plan's."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import msgspec

from tega.errors import DeviceUnavailableError, RecordingError
from tega.foreign_file import read_foreign
from tega.study.journal import read_events
from tega.study.lead.trial import recording_folder
from tega.study.order import shuffled
from tega.study.plan import read_plan
from tega.study.score.boris import attempts
from tega.study.state import events_path


class RecordedTrial(NamedTuple):
    """A trial with a recording, without its condition.

    Attributes:
        id: Such as ``p01-t07``.
        trial: Its number in the plan, which a rater must not see.
        attempt: The one that counts.
        object: What is lifted.
        start_ns: Of the trial, on the session's clock.
        length_ns: From its start to its end.
        zero_ns: The trial's start, counted from the recording's.
        folder: Of the recording.
    """

    id: str
    trial: int
    attempt: int
    object: str
    start_ns: int
    length_ns: int
    zero_ns: int
    folder: Path


class Unseen(NamedTuple):
    """A trial that cannot be shown, and why."""

    id: str
    why: str


class _Facts(msgspec.Struct):
    """What ``trial.json`` says of a recording."""

    trial: str
    attempt: int
    zero_ns: int
    started_ns: int


def recorded_trials(folder: Path, participant: str, rater: str) -> tuple[list[RecordedTrial], list[Unseen]]:
    """Return a person's recorded trials that count, in the order in which a rater sees them.

    The order is drawn from the study's seed, the person and the rater, over all trials of the plan: it does not change
    when trials are added, and tells nothing of the conditions.

    Args:
        folder: The study's folder.
        participant: Whose.
        rater: Who scores.

    Returns:
        The trials, and those without a recording that can be used, as far as their files tell without being read.

    Raises:
        InvalidValueError: Nobody has that id.
        RecordingError: The study is damaged, or the person has withdrawn.
        DeviceUnavailableError: No trial can be shown.
    """
    from tega.study.privacy import withdrawn_ids

    plan = read_plan(folder)
    planned = plan.of(participant)
    if participant in withdrawn_ids(folder):
        raise RecordingError(f"{participant} has withdrawn", "go on with another participant")
    ended = {
        start.trial: (start, end)
        for start, end in attempts(read_events(events_path(folder, participant)))
        if end.status in {"done", "failed_task"}
    }
    found: list[RecordedTrial] = []
    unseen: list[Unseen] = []
    for trial in shuffled(planned, seed=plan.settings.seed or 0, purpose=f"recorded|{participant}|{rater}"):
        if trial.trial not in ended:
            continue
        start, end = ended[trial.trial]
        where = recording_folder(folder, trial, start.attempt)
        try:
            zero_ns = _begins(where, trial.id, start.attempt, start.t_ns)
        except RecordingError as error:
            unseen.append(Unseen(trial.id, error.message))
            continue
        length_ns = max(end.t_ns - start.t_ns, 1)
        found.append(
            RecordedTrial(
                trial.id, trial.trial, start.attempt, trial.object, start.t_ns, length_ns, zero_ns, where
            )
        )
    if not found:
        why = "; ".join(f"{one.id}: {one.why}" for one in unseen) or "no trial that counts has ended"
        raise DeviceUnavailableError(
            f"{participant}: no recording to score: {why}",
            "record trials with tega-teleop study run, or score live without --recorded",
        )
    return found, sorted(unseen)


def _begins(where: Path, trial_id: str, attempt: int, start_ns: int) -> int:
    """Return where in its recording a trial begins, nanoseconds.

    Raises:
        RecordingError: There is no finished recording of this trial.
    """
    if not (path := where / "trial.json").exists():
        raise RecordingError("no recording" if not where.exists() else "trial.json is missing")
    try:
        facts = msgspec.json.decode(read_foreign(path, most_mib=1), type=_Facts)
    except (msgspec.DecodeError, OSError, ValueError, RecursionError) as error:
        raise RecordingError(f"trial.json is damaged: {error}") from error
    if (facts.trial, facts.attempt) != (trial_id, attempt):
        raise RecordingError(f"the recording is of another trial, {facts.trial} attempt {facts.attempt}")
    if facts.started_ns != start_ns:
        raise RecordingError("the recording is of another session, begun at another time")
    if not any(where.glob("*.mcap")) and not (where / "truth.csv").exists():
        unfinished = any(where.glob("*.part"))
        raise RecordingError("the recording was never finished" if unfinished else "no recording")
    return start_ns - facts.zero_ns
