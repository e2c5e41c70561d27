"""Give the loop what it received and decided in a recorded run, at the ticks at which it did."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from itertools import count
from typing import Any

import numpy as np

from tega import records
from tega.config import SessionConfig
from tega.config.choose import grip_reflex
from tega.hand import joined_level
from tega.haptics import MotorLevels
from tega.loop.controls import lit_frame
from tega.loop.inbox.stream import NEVER_NS, LiveStream
from tega.loop.pacing import Pacer
from tega.loop.reflex import ReflexArc, ReflexInputs
from tega.recording.replay.feed import Newest, RecordFeed
from tega.recording.replay.measured import Measured
from tega.records import Contact, HandLook, Imposed, Intent, ReflexGrip
from tega.records.bus import Bus
from tega.runtime.clock import ManualClock
from tega.safety.guard import Guard

_SETTLE_NS = 1_000_000_000
# More than come in one tick after the longest standstill.
_MOST = 1 << 20


class RecordedRun(Pacer):
    """Paces the loop by a recorded run's ticks, and gives it what the run received and decided at each.

    The recording is read as far as each deadline needs it. Deadlines that were left out are left out, and the
    loop is woken where it was woken. If every source had ended, the streams end with its last tick.

    ``measured`` knows what each contact and intent is now; ``settle`` is called about every second with the
    tick. ``levels`` are the loop's intents, ``None`` without EMG; ``active`` is whether motors were tried in
    the run, or a program sent frames.
    """

    def __init__(self, feed: RecordFeed, measured: Measured, settle: Callable[[int], None]) -> None:
        super().__init__(ManualClock())
        self._feed, self._measured, self._settle = feed, measured, settle
        self.contacts = {f: LiveStream[Contact](capacity=_MOST) for f in feed.head.baselines}
        self.levels = LiveStream[Intent](capacity=_MOST) if "emg" in feed.head.sources else None
        self._streams: list[LiveStream[Any]] = [*self.contacts.values(), *filter(None, [self.levels])]
        self.active = feed.holds(records.TriedMotor) or feed.holds(records.ProgramFrame)
        self._taken = deque[Contact | Intent]()  # in the file's order, which is that of their ticks
        self._calls = count()
        self._switches: dict[int, bool] = {}
        self._haptics = True
        self._newest: list[Newest[Any]] = []
        self._tried, self._sent = self.newest(records.TriedMotor), self.newest(records.ProgramFrame)
        self._skips, self._looks = self.newest(records.Skip), self.newest(HandLook)
        self._settled_ns, self.tick_ns = 0, -1
        feed.bus.subscribe(
            records.Haptics, lambda one: self._switches.update({one.n_asked: one.on}), vital=True
        )
        feed.bus.subscribe(Contact, self._taken.append, vital=True)
        feed.bus.subscribe(Intent, self._taken.append, vital=True)

    def newest(self, kind: Any) -> Newest[Any]:
        """Return the records of a type as the recording is read; those that ticks have passed are forgotten."""
        found = Newest[Any]()
        self._newest.append(found)
        self._feed.bus.subscribe(kind, found.rows.append, vital=True)
        return found

    def doze(self, t_ns: int) -> int:
        """Return when the loop was woken, or the deadline."""
        self._feed.read_until(t_ns)
        if not self._taken or self._taken[0].taken_ns >= t_ns:
            return t_ns
        self._reach(self._taken[0].taken_ns)
        return self.tick_ns

    def wait(self, t_ns: int) -> bool:
        """Go to a deadline; return whether its tick was carried out."""
        self._feed.read_until(t_ns)
        self.n_waits += 1
        self._reach(t_ns)
        if t_ns - self._settled_ns > _SETTLE_NS:
            self._settled_ns = t_ns
            self._settle(t_ns)
            for newest in self._newest:
                newest.until(t_ns)
        return self._skips.at(t_ns) is None

    def over(self) -> bool:
        """Return whether the run was over."""
        end = self._feed.end
        if self._feed.ended and self.tick_ns > self._feed.newest_ns + _SETTLE_NS:
            return True  # a damaged number of ticks, or a damaged tick of an item
        if end is None:
            return self._feed.ended and self.tick_ns >= self._feed.last_tick_ns and self.n_waits > 0
        return self.n_waits >= end.n_waits and not self._taken

    def put_rest(self) -> None:
        """Put in what is left when the run is over."""
        self._feed.read_rest()
        self._put(NEVER_NS)

    def look(self, t_ns: int, _level: float) -> HandLook | None:
        """Return the look at hand and arm of a tick."""
        return self._looks.at(t_ns)

    def haptics(self) -> bool:
        """Return whether motors could turn, one call after the other."""
        self._haptics = self._switches.pop(next(self._calls), self._haptics)
        return self._haptics

    def frame(self, t_ns: int, frame: MotorLevels) -> MotorLevels:
        """Return the frame of a tick, with the motor that was tried then, or that of the program."""
        program, tried = self._sent.until(t_ns), self._tried.until(t_ns)
        if program is not None and program.intensities:
            frame = MotorLevels(frame.layout, np.array(program.intensities, np.uint8))
        return frame if tried is None or not tried.percent else lit_frame(frame, tried.motor, tried.percent)

    def sent(self, t_ns: int, sent: MotorLevels | None) -> None:
        """Do nothing: a trial was answered in the run."""

    def _reach(self, t_ns: int) -> None:
        self.tick_ns, end = t_ns, self._feed.end
        # The last tick of a set time is before its end, and takes in what came until then.
        last = end is not None and end.ended == "duration" and t_ns >= end.end_ns
        self._put(NEVER_NS if last else t_ns)
        if end is not None and end.ended == "complete" and self.over():
            for stream in self._streams:
                stream.end(end.end_ns)

    def _put(self, t_ns: int) -> None:
        while self._taken and self._taken[0].taken_ns <= t_ns:
            record = self._taken.popleft()
            if isinstance(record, Contact):
                if (contact := self._measured.contact(record)) is not None:
                    self.contacts[record.finger].put(contact)
            elif (intent := self._measured.intent(record)) is not None and self.levels is not None:
                self.levels.put(intent)


class RecordedGuard(Guard):
    """Guard of a recorded run: it imposes the recorded levels, each from its tick on."""

    def __init__(self, imposed: Newest[Imposed], tick_ns: Callable[[], int]) -> None:
        super().__init__()
        self._imposed, self._tick_ns = imposed, tick_ns

    def due(self, t_ns: int, late_ns: int) -> bool:  # noqa: ARG002
        """Return false: the guard's findings are in the recording."""
        return False

    def level(self, wanted: float) -> float:
        """Return the imposed level, or the wanted one where none is imposed."""
        imposed = self._imposed.until(self._tick_ns())
        return wanted if imposed is None else joined_level(imposed.level, imposed.closure) or wanted


def recorded_arc(
    config: SessionConfig,
    fingers: Iterable[str],
    newest: Callable[[type[ReflexGrip]], Newest[ReflexGrip]],
    bus: Bus,
) -> ReflexArc | None:
    """Make the reflex of a recorded run, under its recorded circumstances; ``None`` where the settings name none."""
    reflex = grip_reflex(config.stages, config.session.preset, list(fingers))
    if reflex is None:
        return None
    grips = newest(ReflexGrip)

    def snapshot(t_ns: int) -> ReflexInputs:
        row = grips.at(t_ns) or ReflexGrip(t_ns=t_ns, own=0.0, added=0.0)  # it was not asked
        return ReflexInputs(row.authority, row.allowed, row.measured)

    return ReflexArc(reflex, config.stages.reflex, snapshot=snapshot, notify=bus.publish)
