"""Compute a recording again: run the loop on it tick by tick as it ran, and compare what comes out.

The loop takes in at each tick what it took in then, so that the replay of a live run does not depend on how the threads
happened to be scheduled. Of a lossless recording everything is computed from the raw pictures and samples; of one with
JPEG pictures from the contacts as recorded, and the pictures are measured beside them to tell the error.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Sequence, Set
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from tega.hand import joined_level
from tega.loop.hand import ModelledAllegro
from tega.loop.hand_output import HandOutput
from tega.loop.inbox.stream import NEVER_NS, Item, PulledStream
from tega.loop.loop import DualLoop
from tega.loop.moment import Moment, Moments
from tega.loop.motor_tests import lit_frame
from tega.loop.pacing import Pacer
from tega.loop.touch_loop import touch_loop
from tega.loop.vest_output import VestOutput
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
from tega.recording.replay.recorded import Recorded, read_recorded
from tega.recording.replay.reflex import RecordedGuard, recorded_arc
from tega.records import (
    Adaptation,
    BusFrame,
    Contact,
    Event,
    HandCommand,
    Intent,
    Record,
    ReflexGrip,
    VestFrame,
)
from tega.records.bus import Bus
from tega.records.schema import values
from tega.runtime.clock import ManualClock
from tega.runtime.files.foreign_file import tells_damage

if TYPE_CHECKING:
    from tega.haptics import MotorLevels
    from tega.wire import CanFrame


# When things were done is no result.
_WHEN = frozenset({"t_ns", "taken_ns", "known_ns"})


class Replay(msgspec.Struct, frozen=True):
    """Findings of a replay.

    Attributes:
        file: The recording.
        lossless: Whether it was computed from the raw streams.
        complete: Whether the recording was finished by the run that made it.
        changed: What of the settings is not the run's own, in words.
        from_s: Where in its session the recording begins; what came before was computed too, and not compared.
        duration_s: How long the loop ran from there on.
        streams: Each one compared.
        pictures: Of JPEG pictures, how approximate they are.
        dropped: Records lost, by topic; what was lost cannot be computed again.
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
    path: Path, *, config: Path | None = None, sets: Sequence[str] = (), bus: Bus | None = None
) -> Replay:
    """Compute a recorded run again and compare.

    Args:
        path: The recording.
        config: Other settings to run it through: preset, vest, calibration, kind of EMG; its devices are not used.
        sets: Single settings to run it through, as ``key=value``.
        bus: Told of all that is computed, for whoever wants to look on.

    Returns:
        What was found.

    Raises:
        RecordingError: The recording cannot be read.
        ConfigError: The other settings cannot be used.
    """
    bus = Bus() if bus is None else bus
    measured = Measured(config, sets, bus)
    recorded = read_recorded(path, begin=measured.begin, frame=measured.frame, chunk=measured.chunk)
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


class _Again(msgspec.Struct):
    """Outputs of the second run."""

    contacts: dict[str, list[Contact]] = {}
    levels: list[Intent] = []
    events: list[Event] = []
    vest: list[tuple[int, str, bytes]] = []
    hand: list[tuple[int, float, Sequence[BusFrame]]] = []
    reflex: list[ReflexGrip] = []
    end_ns: int = 0

    def contact(self, contact: Contact) -> None:
        self.contacts[contact.finger].append(contact)

    def vest_frame(self, frame: VestFrame) -> None:
        self.vest.append((frame.t_ns, frame.layout, bytes(frame.intensities)))

    def command(self, command: HandCommand) -> None:
        self.hand.append((command.t_ns, joined_level(command.level, command.closure), command.frames))


def _run(recorded: Recorded, measured: Measured, bus: Bus) -> _Again:
    head, config = recorded.head, measured.config
    again = _Again({finger: [] for finger in recorded.contacts})
    pacer = _RecordedPacer(recorded)
    reflex = recorded_arc(recorded, config, tell=again.reflex.append)
    steered = head.facts["steered"] == "true"
    hand = (_UnseenHand if steered else ModelledAllegro)(device_id=config.hand.device_id)
    with_emg = "emg" in head.sources
    bus.subscribe(Contact, again.contact, vital=True)
    bus.subscribe(Intent, again.levels.append, vital=True)
    if "Event" in head.versions:  # earlier recordings have no events
        bus.subscribe(Event, again.events.append, vital=True)
    bus.subscribe(VestFrame, again.vest_frame, vital=True)
    if head.facts["observed"] == "true":
        bus.subscribe(Moment, lambda _moment: None)
    bus.subscribe(HandCommand, again.command, vital=True)
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
        look=(lambda t_ns, _level: recorded.looks.get(t_ns)) if recorded.looks else None,
    )
    ended = "" if recorded.end is None else recorded.end[1]
    duration_ns = recorded.end[0] if recorded.end is not None and ended == "duration" else None
    report = loop.run(duration_ns=duration_ns, stop=pacer.over, endless=bool(recorded.turns))
    again.end_ns = report.end_ns
    return again


def _recorded_haptics(recorded: Recorded) -> Callable[[], bool]:
    """Return whether motors could turn, one call after the other."""
    changes = {n_asked: on for n_asked, on, _ in recorded.haptics}
    numbers, on = count(), True

    def haptics() -> bool:
        nonlocal on
        on = changes.get(next(numbers), on)
        return on

    return haptics


class _RecordedTrials:
    """Motors that were tried in the run."""

    def __init__(self, recorded: Recorded) -> None:
        self._rows = recorded.tried
        self.active = bool(recorded.tried)

    def frame(self, t_ns: int, frame: MotorLevels) -> MotorLevels:
        before = [row for row in self._rows if row[0] <= t_ns][-1:]
        return lit_frame(frame, *before[0][1:]) if before and before[0][2] else frame

    def sent(self, t_ns: int, sent: MotorLevels | None) -> None:
        """Do nothing: the answer was given in the run."""


def _as_taken(items: list[tuple[int, Item]], pacer: _RecordedPacer, recorded: Recorded) -> PulledStream[Item]:
    """Return a stream whose items come at the ticks at which they were taken in.

    Where every source had ended, it ends with the last tick of the run.
    """
    end_ns, ended, _ = recorded.end or (0, "", 0)
    # The last look of a set time is before its end.
    latest_ns = end_ns - 1 if ended == "duration" else NEVER_NS
    return PulledStream(
        [item for _, item in items],
        end_ns=end_ns,
        known=[min(taken_ns, latest_ns) for taken_ns, _ in items],
        over=pacer.over if ended == "complete" else lambda: False,
    )


class _RecordedPacer(Pacer):
    """Leaves out the deadlines that were left out, wakes where the loop was woken, and knows when the run was over."""

    def __init__(self, recorded: Recorded) -> None:
        super().__init__(ManualClock())
        self._skipped = recorded.skipped
        taken = {contact.taken_ns for contacts in recorded.contacts.values() for contact in contacts}
        taken |= {intent.taken_ns for intent in recorded.levels}
        self._turns_ns = deque(sorted(taken))
        self._last_ns = recorded.last_tick_ns
        self._n_most = None if recorded.end is None else recorded.end[2]
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
    """Tell pictures whose pixels are not those that were taken, whether or not they change what is felt."""
    return [
        compare(f"/tactile/{finger}/image", [(t, a) for t, a, _ in rows], [(t, b) for t, _, b in rows])
        for finger, rows in measured.pixels.items()
    ]


def _compare(recorded: Recorded, again: _Again, cut_ns: int | None) -> list[Comparison]:
    streams = []
    for finger, contacts in recorded.contacts.items():
        n = recorded.n_early.get(finger, 0)
        ours = [(c.t_ns, _row(c)) for c in contacts[n:]]
        theirs = [(c.t_ns, _row(c)) for c in again.contacts[finger][n:]]
        streams.append(compare(f"/tactile/{finger}/contact", ours, theirs, until_ns=cut_ns))
    if "emg" in recorded.head.sources:
        n = recorded.n_early.get("emg", 0)
        # Before version 3 it was lost on the way to the file.
        unkept = {"activity"} if int(recorded.head.versions.get("Levels", "1")) < 3 else set()
        ours, theirs = (
            [(row.t_ns, _row(row, _WHEN | unkept)) for row in rows[n:]]
            for rows in (recorded.levels, again.levels)
        )
        streams.append(compare("/emg/levels", ours, theirs, until_ns=cut_ns))
    from_ns = recorded.from_ns
    if events := [event for event in again.events if event.taken_ns >= from_ns] + recorded.events:
        found = events[: len(events) - len(recorded.events)]
        ours, theirs = ([(e.t_ns, values(e)) for e in rows] for rows in (recorded.events, found))
        streams.append(compare(events[0].where, ours, theirs, until_ns=cut_ns))
    vest = [row for row in again.vest if row[0] >= from_ns]
    streams.append(compare("/vest/frame", _vest_rows(recorded.vest), _vest_rows(vest), until_ns=cut_ns))
    if recorded.head.live_vest:
        ours = [(t, {"sent": True}) for t in recorded.vest_sent]
        made = Counter(t for t, _, _ in vest)
        if recorded.head.facts.get("sent") != "every":
            # The loop once left frames out that the vest showed already: what was sent then was made at that time.
            made &= Counter(recorded.vest_sent)
        theirs = [(t, {"sent": True}) for t in made.elements()]
        streams.append(compare("/vest/sent", ours, theirs, until_ns=cut_ns))
    if "emg" in recorded.head.sources:
        steered = recorded.head.facts["steered"] == "true"
        ours, theirs = (
            [
                (t, {"level": level} | ({} if steered else {"frames": _hex(frames)}))
                for t, level, frames in rows
            ]
            for rows in (recorded.hand, [row for row in again.hand if row[0] >= from_ns])
        )
        streams.append(compare("/hand/frames", ours, theirs, until_ns=cut_ns))
    added = [row for row in again.reflex if row.t_ns >= from_ns]
    told = [row for row in recorded.reflex if row.t_ns >= from_ns]
    if added or told:
        ours, theirs = ([(row.t_ns, values(row)) for row in rows] for rows in (told, added))
        streams.append(compare(ReflexGrip.topic, ours, theirs, until_ns=cut_ns))
    return streams


def _compare_adaptations(recorded: Recorded, measured: Measured) -> list[Comparison]:
    """Compare every change of gains and offsets of EMG."""
    ours = recorded.adaptations
    theirs = [one for one in measured.adaptations if one.t_ns >= recorded.from_ns]
    if recorded.end is None:  # samples may have been recorded later than what was made of them
        theirs = theirs[: len(ours)]
    if not (ours or theirs):
        return []
    rows, again = ([(one.t_ns, values(one)) for one in some] for some in (ours, theirs))
    return [compare(Adaptation.topic, rows, again)]


def _row(record: Record, without: Set[str] = _WHEN) -> dict[str, Any]:
    return {name: value for name, value in values(record).items() if name not in without}


def _vest_rows(rows: Sequence[tuple[int, str, bytes]]) -> list[tuple[int, dict[str, Any]]]:
    return [(t, {"layout": layout, "intensities": list(levels)}) for t, layout, levels in rows]


def _hex(frames: Sequence[BusFrame]) -> str:
    return " ".join(f"{f.id:03X}#{'R' if f.remote else f.data.hex().upper()}" for f in frames)
