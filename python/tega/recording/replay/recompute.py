"""Re-run a recording: run the loop on it tick by tick as it ran, and compare the output.

The loop receives at each tick the input that it received in the run, so the replay of a live run does not depend on
how threads were scheduled. For a lossless recording everything is computed from the raw frames and samples. With JPEG
images it is computed from the recorded contacts, and the images are measured as well to find the error.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from tega.haptics import MotorLevels
from tega.loop.hand import ModelledAllegro
from tega.loop.hand_output import HandOutput
from tega.loop.inbox.stream import NEVER_NS
from tega.loop.loop import DualLoop
from tega.loop.moment import Moment, Moments
from tega.loop.motor_tests import lit_frame
from tega.loop.touch_loop import touch_loop
from tega.loop.vest_output import VestOutput
from tega.recording.mcap_reader import Progress
from tega.recording.replay.arm import compare_arm
from tega.recording.replay.compare import Comparison
from tega.recording.replay.comparing import Comparing
from tega.recording.replay.exchanges import compare_exchanges
from tega.recording.replay.feed import RecordFeed, newest
from tega.recording.replay.inbox import RecordedPacer, TakenItems
from tega.recording.replay.measured import Measured
from tega.recording.replay.picture_errors import PictureError, PictureErrors
from tega.recording.replay.reflex import RecordedGuard, recorded_arc
from tega.records import (
    ArmTurn,
    Contact,
    HandExchange,
    HandLook,
    Haptics,
    Imposed,
    Intent,
    ProgramFrame,
    ReflexGrip,
    TriedMotor,
)
from tega.records.bus import Bus
from tega.runtime.files.foreign_file import tells_damage

if TYPE_CHECKING:
    from tega.wire import CanFrame


class Replay(msgspec.Struct, frozen=True):
    """Findings of a replay.

    Attributes:
        file: The recording.
        lossless: Whether it was computed from the raw streams.
        complete: Whether the recording was finished by the run that made it.
        changed: Settings that differ from the run's own, in words.
        from_s: Beginning of the recording in its session; the time before is computed too, but not compared.
        duration_s: Duration of the loop from there on.
        streams: Each one compared.
        pictures: Errors of JPEG images.
        dropped: Records lost, by topic; these cannot be computed again.
        same: Whether nothing differs.
        pose_base: Number of the most open level in the run's settings, 0 or 1.
    """

    file: str
    lossless: bool
    complete: bool
    changed: list[str]
    from_s: float
    duration_s: float
    streams: list[Comparison]
    pictures: list[PictureError]
    dropped: dict[str, int]
    same: bool
    pose_base: int = 1


@tells_damage
def replay_file(
    path: Path,
    *,
    config: Path | None = None,
    sets: Sequence[str] = (),
    bus: Bus | None = None,
    progress: Progress | None = None,
) -> Replay:
    """Compute a recorded run again and compare.

    Args:
        path: The recording.
        config: Other settings to run it through: preset, vest, calibration, kind of EMG; its devices are not used.
        sets: Single settings to run it through, as ``key=value``.
        bus: Every computed record is published here, for displays.
        progress: Called as the file is read.

    Returns:
        The findings of the comparison.

    Raises:
        RecordingError: The recording cannot be read.
        ConfigError: The other settings cannot be used.
    """
    bus = Bus() if bus is None else bus
    measured = Measured(config, sets, bus)
    feed = RecordFeed(path, frame=measured.frame, chunk=measured.chunk, progress=progress)
    head = feed.head
    measured.begin(head)
    comparing = Comparing(feed, measured, bus)
    errors = PictureErrors(head.baselines)
    beside = [compare_exchanges(feed)] if feed.holds(HandExchange) else []
    beside += [compare_arm(feed, measured.arm)] if feed.holds(ArmTurn) else []
    end_ns = _run(feed, measured, comparing, errors, bus)
    streams = [*comparing.results(), *(compared.result() for compared in beside)]
    return Replay(
        file=path.name,
        lossless=head.lossless,
        complete=feed.complete,
        changed=measured.changed,
        from_s=head.from_ns / 1e9,
        duration_s=(end_ns - head.from_ns) / 1e9,
        streams=streams,
        pictures=[] if measured.again else errors.found(),
        dropped=feed.lost,
        same=not any(stream.differ for stream in streams),
        pose_base=measured.config.session.pose_base,
    )


def _run(feed: RecordFeed, measured: Measured, comparing: Comparing, errors: PictureErrors, bus: Bus) -> int:
    """Run the loop on the recording; return when it ended."""
    head, config = feed.head, measured.config
    pacer = RecordedPacer(feed, comparing.settle)
    # A real hand closed its own loop: its frames are not the loop's.
    hand = (_UnseenHand if head.facts["steered"] == "true" else ModelledAllegro)(
        device_id=config.hand.device_id
    )
    with_emg = "emg" in head.sources
    if head.facts["observed"] == "true":
        bus.subscribe(Moment, lambda _moment: None)
    contacts: dict[str, TakenItems[Contact]] = {
        finger: TakenItems(feed, pacer, partial(_contact, measured, errors, feed))
        for finger in head.baselines
    }
    levels: TakenItems[Intent] = TakenItems(feed, pacer, partial(_intent, measured))
    feed.bus.subscribe(Contact, lambda contact: contacts[contact.finger].rows.append(contact), vital=True)
    feed.bus.subscribe(Intent, levels.rows.append, vital=True)
    touch = touch_loop(config, measured.calibration, list(head.baselines))
    looks = newest(feed, HandLook)
    loop = DualLoop(
        pacer=pacer,
        touch=touch,
        contacts={finger: items.stream for finger, items in contacts.items()},
        levels=levels.stream if with_emg else None,
        hand=HandOutput(
            hand,
            bus=bus,
            reflex=recorded_arc(newest(feed, ReflexGrip), head.baselines, config, tell=bus.publish),
        ),
        vest=VestOutput(
            touch,
            bus=bus,
            now_ns=pacer.elapsed_ns,
            rate_hz=config.vest.rate_hz,
            by_frame=(config.vest.pace or head.facts.get("pace", "steady")) == "by-frame",
            haptics=_recorded_haptics(feed),
            tests=_RecordedTrials(feed),
        ),
        bus=bus,
        guard=RecordedGuard(newest(feed, Imposed), lambda: pacer.tick_ns),
        moments=Moments(bus, hand if with_emg else None),
        look=(lambda t_ns, _level: looks.at(t_ns)) if feed.holds(HandLook) else None,
    )
    end = feed.end
    duration_ns = end.end_ns if end is not None and end.ended == "duration" else None
    feed.read_until(0)
    report = loop.run(duration_ns=duration_ns, stop=pacer.over, endless=feed.holds(ArmTurn))
    feed.read_rest()
    for items in contacts.values():
        items.fill(NEVER_NS)
    return report.end_ns


def _contact(
    measured: Measured, errors: PictureErrors, feed: RecordFeed, recorded: Contact
) -> Contact | None:
    """Return what a recorded contact is now: measured again, or as recorded where that is not possible."""
    again = measured.contacts[recorded.finger].at(recorded.t_ns)
    if measured.again and recorded.taken_ns >= feed.head.from_ns:  # of earlier ones there are no pictures
        return again
    if again is not None:
        errors.note(recorded, again)
    return recorded


def _intent(measured: Measured, recorded: Intent) -> Intent | None:
    return measured.intents.at(recorded.t_ns) if measured.decodes else recorded


def _recorded_haptics(feed: RecordFeed) -> Callable[[], bool]:
    """Return whether motors could turn, one call after the other."""
    changes, numbers, on = dict[int, bool](), count(), True
    feed.bus.subscribe(Haptics, lambda one: changes.update({one.n_asked: one.on}), vital=True)

    def haptics() -> bool:
        nonlocal on
        on = changes.pop(next(numbers), on)
        return on

    return haptics


class _RecordedTrials:
    """Motors that were tried in the run, and frames that a program sent."""

    def __init__(self, feed: RecordFeed) -> None:
        self._tried, self._sent = newest(feed, TriedMotor), newest(feed, ProgramFrame)
        self.active = feed.holds(TriedMotor) or feed.holds(ProgramFrame)

    def frame(self, t_ns: int, frame: MotorLevels) -> MotorLevels:
        program, tried = self._sent.until(t_ns), self._tried.until(t_ns)
        if program is not None and program.intensities:
            frame = MotorLevels(frame.layout, np.array(program.intensities, np.uint8))
        return frame if tried is None or not tried.percent else lit_frame(frame, tried.motor, tried.percent)

    def sent(self, t_ns: int, sent: MotorLevels | None) -> None:
        """Do nothing: the answer was given in the run."""


class _UnseenHand(ModelledAllegro):
    """A real hand that closed its own loop: its frames are not the loop's."""

    def step(self, level: float, added: float = 0.0) -> list[CanFrame]:  # noqa: ARG002
        return []

    def limp(self) -> list[CanFrame]:
        return []
