"""Find lift-off and slip in the signals of a study's trials: the detector as one more account.

It uses recordings of the fingertips, the hand and the arm alone. Its events are stored beside the session's in
``detected.jsonl``, with their confidence, and are compared like a rater's. They never replace a rater's events.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec

from tega.errors import RecordingError
from tega.haptics import FINGERS
from tega.records.touch import CERTAIN
from tega.stages.events import DetectedEvent, Detector, TouchFrame
from tega.stages.events.settings import SETTINGS
from tega_study.attempt_rows import HAND, TOUCH, HandRow, TouchRow, read_hand, read_touch, recording_folder
from tega_study.journal import JournalEvent, Kind, attempts, events_path, read_events, replaced_journal
from tega_study.plan import read_plan
from tega_study.study_notes import staying

DETECTOR = "detector"
DETECTED = ("lift_off", "slip")
"""Events of the detector that a study counts."""

NOT_OBSERVABLE = "not observable on this rig"
"""Text of the note in a session's ``detected.jsonl`` that names such a kind of event."""


class TrialEvents(msgspec.Struct, frozen=True):
    """Events that the detector found in one attempt, in order of time; seconds from the trial's start.

    ``missing``: signals that the attempt did not record, ``closure`` of the hand or ``height`` of the arm.
    """

    participant: str
    trial: int
    attempt: int
    object: str
    events: tuple[DetectedEvent, ...]
    missing: tuple[str, ...] = ()

    @property
    def unobservable(self) -> tuple[Kind, ...]:
        """Kinds of events that cannot be observed without the missing signals."""
        kinds: tuple[Kind, ...] = ("lift_off",) if "height" in self.missing else ()
        return (*kinds, "slip") if self.missing else kinds


def detected_path(folder: Path, participant: str) -> Path:
    """Return where the detector's events of a session are."""
    return events_path(folder, participant).with_name("detected.jsonl")


def read_detected(folder: Path, participant: str) -> list[JournalEvent]:
    """Read the detector's events of a session; none before ``study detect``."""
    return read_events(detected_path(folder, participant))


def events_of(
    touch: Sequence[TouchRow], hand: Sequence[HandRow], *, live: bool = False
) -> list[DetectedEvent]:
    """Find the events of a trial; ``live``: only those that could be known at the time, as in the run."""
    detector = Detector(look_ahead_s=0.0 if live else SETTINGS.look_ahead_s)
    found: list[DetectedEvent] = []
    items: list[tuple[float, int, TouchRow | HandRow]] = [
        *((row.t_s, 1, row) for row in touch),
        *((row.t_s, 0, row) for row in hand),
    ]
    last_s = 0.0
    for t_s, _, row in sorted(items, key=lambda item: item[:2]):
        last_s = t_s
        if isinstance(row, TouchRow):
            seen = TouchFrame(bool(row.in_contact), row.eda, row.mass, row.peak, row.x, row.y)
            found += detector.touch(t_s, row.finger, seen)
        else:
            tips_mm = None if row.tips_mm is None else dict(zip(FINGERS, row.tips_mm, strict=True))
            found += detector.hand(
                t_s, level=row.level, closure=row.closure, height_m=row.height_m, tips_mm=tips_mm
            )
    found += detector.close(last_s)
    return sorted(found, key=lambda event: event.t_s)


def detect_study(folder: Path, participants: Sequence[str] = (), *, live: bool = False) -> list[TrialEvents]:
    """Find the events of a study's attempts and write them beside each session's, in place of earlier ones.

    Raises ``RecordingError`` if no attempt has frames of its fingertips.
    """
    plan = read_plan(folder)
    stay = staying(folder, plan)
    found: list[TrialEvents] = []
    for person in participants or plan.participants:
        mine = {trial.trial: trial for trial in plan.of(person)}
        if person not in stay:
            continue
        rows: list[tuple[JournalEvent, JournalEvent, TrialEvents]] = []
        for start, end in attempts(read_events(events_path(folder, person))):
            trial = mine[start.trial]
            where = recording_folder(folder, trial, start.attempt)
            if not (where / TOUCH).exists():
                continue
            touch, hand = read_touch(where / TOUCH), read_hand(where / HAND)
            fields = {"closure": "closure", "height": "height_m"}
            missing = tuple(
                name for name, field in fields.items() if all(getattr(row, field) is None for row in hand)
            )
            done = TrialEvents(person, start.trial, start.attempt, trial.object, (), missing)
            events = tuple(
                event
                for event in events_of(touch, hand, live=live)
                if event.t_s >= 0 and event.confidence >= CERTAIN and event.kind not in done.unobservable
            )
            done = msgspec.structs.replace(done, events=events)
            rows.append((start, end, done))
        if rows:
            with replaced_journal(detected_path(folder, person)) as journal:
                signed = plan.settings.plan_sha256
                journal.add("session_start", t_ns=rows[0][0].t_ns, source=DETECTOR, text=signed)
                for start, end, done in rows:
                    journal.add_attempt((start, end), DETECTOR, _fields(start, end, done))
        found += [done for _start, _end, done in rows]
    if not found:
        raise RecordingError(
            f"{folder}: no trial has frames of its fingertips",
            "run trials with tega-teleop study run; study simulate keeps none",
        )
    return found


def _fields(start: JournalEvent, end: JournalEvent, done: TrialEvents) -> list[dict[str, Any]]:
    """Return the fields of an attempt's events, and a note for each kind that cannot be observed."""
    return [
        *(
            {"kind": e.kind, "t_ns": start.t_ns + round(e.t_s * 1e9), "value": round(e.confidence, 3)}
            for e in done.events
            if e.kind in DETECTED
        ),
        *(
            {"kind": "note", "t_ns": end.t_ns, "item": kind, "text": NOT_OBSERVABLE}
            for kind in done.unobservable
        ),
    ]
