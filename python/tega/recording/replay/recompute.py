"""Re-run a recording: run the loop on it tick by tick as it ran, and compare the output.

The loop receives at each tick the input that it received in the run, so the replay of a live run does not depend on
how threads were scheduled. For a lossless recording everything is computed from the raw frames and samples. With JPEG
images it is computed from the recorded contacts, and the images are measured as well to find the error.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Sequence, Set
from functools import partial
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import msgspec
import numpy as np

from tega.hand import joined_level
from tega.haptics import MotorLevels
from tega.loop.hand import ModelledAllegro
from tega.loop.hand_output import HandOutput
from tega.loop.inbox.stream import NEVER_NS, Item, PulledStream
from tega.loop.loop import DualLoop
from tega.loop.moment import Moment, Moments
from tega.loop.motor_tests import lit_frame
from tega.loop.pacing import Pacer
from tega.loop.touch_loop import touch_loop
from tega.loop.vest_output import VestOutput
from tega.recording.mcap_reader import Progress
from tega.recording.replay.arm import compare_arm
from tega.recording.replay.beside import compare_beside
from tega.recording.replay.compare import Comparison, compare
from tega.recording.replay.exchanges import compare_exchanges
from tega.recording.replay.measured import (
    Measured,
    PictureError,
    contact_items,
    level_items,
    measured_again,
    picture_errors,
)
from tega.recording.replay.recorded import Kind, Recorded, read_recorded
from tega.recording.replay.reflex import RecordedGuard, recorded_arc
from tega.records import (
    Adaptation,
    ArmTurn,
    BusFrame,
    Contact,
    End,
    Event,
    HandCommand,
    Haptics,
    Intent,
    ProgramFrame,
    Record,
    ReflexGrip,
    SentFrame,
    Skip,
    TriedMotor,
    VestFrame,
)
from tega.records.bus import Bus
from tega.records.schema import values
from tega.runtime.clock import ManualClock
from tega.runtime.files.foreign_file import tells_damage

if TYPE_CHECKING:
    from tega.wire import CanFrame


# When things were done is no result.
_WHEN = frozenset({"t_ns", "taken_ns", "known_ns"})
_COMPARED: Final[tuple[type[Record], ...]] = (Contact, Intent, Event, VestFrame, HandCommand, ReflexGrip)


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
    recorded = read_recorded(
        path, begin=measured.begin, frame=measured.frame, chunk=measured.chunk, progress=progress
    )
    again = _run(recorded, measured, bus)
    cut_ns = None if recorded.end is not None else recorded.last_tick_ns
    streams = _compare_pixels(measured) if recorded.head.lossless else []
    streams += _compare(recorded, again, cut_ns)
    streams += compare_beside(recorded, measured)
    streams += _compare_adaptations(recorded, measured)
    streams += compare_exchanges(recorded)
    streams += compare_arm(recorded, measured.arm)
    return Replay(
        file=path.name,
        lossless=recorded.head.lossless,
        complete=recorded.complete,
        changed=measured.changed,
        from_s=recorded.from_ns / 1e9,
        duration_s=(again.end_ns - recorded.from_ns) / 1e9,
        streams=streams,
        pictures=[] if measured_again(recorded, measured) else picture_errors(recorded, measured),
        dropped=recorded.dropped,
        same=not any(stream.differ for stream in streams),
        pose_base=measured.config.session.pose_base,
    )


class _Again:
    """Records of the second run, by type."""

    def __init__(self, bus: Bus, kinds: Sequence[type[Record]]) -> None:
        self.end_ns = 0
        self._records: dict[type[Record], list[Any]] = {kind: [] for kind in kinds}
        for kind, records in self._records.items():
            bus.subscribe(kind, records.append, name="replay", vital=True)

    def of(self, kind: type[Kind]) -> list[Kind]:
        """Return the records of a type, in order."""
        return self._records.get(kind, [])


def _run(recorded: Recorded, measured: Measured, bus: Bus) -> _Again:
    head, config = recorded.head, measured.config
    # Earlier recordings have no events.
    again = _Again(bus, [kind for kind in _COMPARED if kind is not Event or "Event" in head.versions])
    pacer = _RecordedPacer(recorded)
    reflex = recorded_arc(recorded, config, tell=bus.publish)
    looks = recorded.looks
    steered = head.facts["steered"] == "true"
    hand = (_UnseenHand if steered else ModelledAllegro)(device_id=config.hand.device_id)
    with_emg = "emg" in head.sources
    if head.facts["observed"] == "true":
        bus.subscribe(Moment, lambda _moment: None)
    contacts = {
        finger: _as_taken(contact_items(recorded, measured, finger), pacer, recorded)
        for finger in recorded.contacts
    }
    touch = touch_loop(config, measured.calibration, recorded.contacts)
    loop = DualLoop(
        pacer=pacer,
        touch=touch,
        contacts=contacts,
        levels=_as_taken(level_items(recorded, measured), pacer, recorded) if with_emg else None,
        hand=HandOutput(hand, bus=bus, reflex=reflex),
        vest=VestOutput(
            touch,
            bus=bus,
            now_ns=pacer.elapsed_ns,
            rate_hz=config.vest.rate_hz,
            by_frame=(config.vest.pace or head.facts.get("pace", "steady")) == "by-frame",
            haptics=_recorded_haptics(recorded),
            tests=_RecordedTrials(recorded),
        ),
        bus=bus,
        guard=RecordedGuard(recorded, lambda: pacer.tick_ns),
        moments=Moments(bus, hand if with_emg else None),
        look=(lambda t_ns, _level: looks.get(t_ns)) if looks else None,
    )
    end = recorded.end
    duration_ns = end.end_ns if end is not None and end.ended == "duration" else None
    report = loop.run(duration_ns=duration_ns, stop=pacer.over, endless=bool(recorded.of(ArmTurn)))
    again.end_ns = report.end_ns
    return again


def _recorded_haptics(recorded: Recorded) -> Callable[[], bool]:
    """Return whether motors could turn, one call after the other."""
    changes = {one.n_asked: one.on for one in recorded.of(Haptics)}
    numbers, on = count(), True

    def haptics() -> bool:
        nonlocal on
        on = changes.get(next(numbers), on)
        return on

    return haptics


class _RecordedTrials:
    """Motors that were tried in the run, and frames that a program sent."""

    def __init__(self, recorded: Recorded) -> None:
        self._tried, self._sent = recorded.of(TriedMotor), recorded.of(ProgramFrame)
        self.active = bool(self._tried or self._sent)

    def frame(self, t_ns: int, frame: MotorLevels) -> MotorLevels:
        program = next((one for one in reversed(self._sent) if one.t_ns <= t_ns), None)
        if program is not None and program.intensities:
            frame = MotorLevels(frame.layout, np.array(program.intensities, np.uint8))
        newest = next((one for one in reversed(self._tried) if one.t_ns <= t_ns), None)
        return (
            frame if newest is None or not newest.percent else lit_frame(frame, newest.motor, newest.percent)
        )

    def sent(self, t_ns: int, sent: MotorLevels | None) -> None:
        """Do nothing: the answer was given in the run."""


def _as_taken(items: list[tuple[int, Item]], pacer: _RecordedPacer, recorded: Recorded) -> PulledStream[Item]:
    """Return a stream with each item at the tick at which the run received it.

    If every source had ended, the stream ends with the last tick of the run.
    """
    end = recorded.end or End(end_ns=0, ended="", n_waits=0)
    # The last look of a set time is before its end.
    latest_ns = end.end_ns - 1 if end.ended == "duration" else NEVER_NS
    return PulledStream(
        [item for _, item in items],
        end_ns=end.end_ns,
        known=[min(taken_ns, latest_ns) for taken_ns, _ in items],
        over=pacer.over if end.ended == "complete" else lambda: False,
    )


class _RecordedPacer(Pacer):
    """Leaves out the deadlines that were left out, wakes where the loop was woken, and knows when the run was over."""

    def __init__(self, recorded: Recorded) -> None:
        super().__init__(ManualClock())
        self._skipped = {skip.t_ns for skip in recorded.of(Skip)}
        taken = {contact.taken_ns for contacts in recorded.contacts.values() for contact in contacts}
        taken |= {intent.taken_ns for intent in recorded.of(Intent)}
        self._turns_ns = deque(sorted(taken))
        self._last_ns = recorded.last_tick_ns
        self._n_most = None if recorded.end is None else recorded.end.n_waits
        self.tick_ns = -1

    def doze(self, t_ns: int) -> int:
        if not self._turns_ns or self._turns_ns[0] >= t_ns:
            return t_ns
        self._reach(self._turns_ns[0])
        return self.tick_ns

    def wait(self, t_ns: int) -> bool:
        self._reach(t_ns)
        self.n_waits += 1
        return t_ns not in self._skipped

    def _reach(self, t_ns: int) -> None:
        self.tick_ns = t_ns
        while self._turns_ns and self._turns_ns[0] <= t_ns:
            self._turns_ns.popleft()

    def over(self) -> bool:
        if self._n_most is None:
            return self.tick_ns >= self._last_ns and self.n_waits > 0
        return self.n_waits >= self._n_most and not self._turns_ns


class _UnseenHand(ModelledAllegro):
    """A real hand that closed its own loop: its frames are not the loop's."""

    def step(self, level: float, added: float = 0.0) -> list[CanFrame]:  # noqa: ARG002
        return []

    def limp(self) -> list[CanFrame]:
        return []


def _compare_pixels(measured: Measured) -> list[Comparison]:
    """Report frames with pixels that differ from the recorded checksums, whether or not the vest frames change."""
    return [
        compare(f"/tactile/{finger}/image", [(t, a) for t, a, _ in rows], [(t, b) for t, _, b in rows])
        for finger, rows in measured.pixels.items()
    ]


def _compare(recorded: Recorded, again: _Again, cut_ns: int | None) -> list[Comparison]:
    head, streams = recorded.head, []
    for finger, contacts in recorded.contacts.items():
        n = recorded.n_early.get(finger, 0)
        computed = [contact for contact in again.of(Contact) if contact.finger == finger]
        ours, theirs = ([(c.t_ns, _row(c)) for c in rows[n:]] for rows in (contacts, computed))
        streams.append(compare(f"/tactile/{finger}/contact", ours, theirs, until_ns=cut_ns))
    with_emg, steered = "emg" in head.sources, head.facts["steered"] == "true"
    if with_emg:
        n = recorded.n_early.get(Intent, 0)
        # Before version 3 it was lost on the way to the file.
        without = _WHEN | {"activity"} if int(head.versions.get("Levels", "1")) < 3 else _WHEN
        ours, theirs = (
            [(row.t_ns, _row(row, without)) for row in rows[n:]]
            for rows in (recorded.of(Intent), again.of(Intent))
        )
        streams.append(compare("/emg/levels", ours, theirs, until_ns=cut_ns))
    rows_of: tuple[tuple[type[Any], Callable[[Any], dict[str, Any]], bool], ...] = (
        (Event, values, "Event" in head.versions),
        (VestFrame, _vest_row, True),
        (SentFrame, lambda _frame: {"sent": True}, head.live_vest),
        (HandCommand, partial(_command_row, steered=steered), with_emg),
        (ReflexGrip, values, True),
    )
    for kind, row, wanted in rows_of:
        ours, theirs = (
            [(one.t_ns, row(one)) for one in records if _known_ns(one) >= recorded.from_ns]
            for records in (recorded.of(kind), _made(kind, recorded, again))
        )
        if wanted and (ours or theirs or kind in {VestFrame, SentFrame, HandCommand}):
            streams.append(compare(kind.topic, ours, theirs, until_ns=cut_ns))
    return streams


def _made(kind: type[Any], recorded: Recorded, again: _Again) -> Sequence[Any]:
    """Return the records of a type from the replay; without a real vest, sent frames are those of the loop."""
    if kind is not SentFrame:
        return again.of(kind)
    frames = {frame.t_ns: frame for frame in again.of(VestFrame)}
    made = Counter(frame.t_ns for frame in again.of(VestFrame))
    if recorded.head.facts.get("sent") != "every":
        # The loop once left frames out that the vest showed already: a frame sent then was made at that time.
        made &= Counter(frame.t_ns for frame in recorded.of(SentFrame))
    return [frames[t_ns] for t_ns in made.elements()]


def _compare_adaptations(recorded: Recorded, measured: Measured) -> list[Comparison]:
    """Compare every change of gains and offsets of EMG."""
    ours = recorded.of(Adaptation)
    theirs = [one for one in measured.adaptations if one.t_ns >= recorded.from_ns]
    if recorded.end is None:  # samples may have been recorded later than what was made of them
        theirs = theirs[: len(ours)]
    if not (ours or theirs):
        return []
    rows, again = ([(one.t_ns, values(one)) for one in some] for some in (ours, theirs))
    return [compare(Adaptation.topic, rows, again)]


def _known_ns(record: Any) -> int:
    """Return the tick at which a record was taken in or made."""
    known_ns: int = getattr(record, "taken_ns", record.t_ns)
    return known_ns


def _row(record: Record, without: Set[str] = _WHEN) -> dict[str, Any]:
    return {name: value for name, value in values(record).items() if name not in without}


def _vest_row(frame: VestFrame) -> dict[str, Any]:
    return {"layout": frame.layout, "intensities": list(frame.intensities)}


def _command_row(command: HandCommand, *, steered: bool) -> dict[str, Any]:
    level = {"level": joined_level(command.level, command.closure)}
    # The frames of a hand that closes its own loop are compared by its exchanges.
    return level if steered else level | {"frames": _hex(command.frames)}


def _hex(frames: Sequence[BusFrame]) -> str:
    return " ".join(f"{f.id:03X}#{'R' if f.remote else f.data.hex().upper()}" for f in frames)
