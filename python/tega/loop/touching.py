"""Inform each finger's metric of loads on other fingers, in live runs and in recordings read side by side."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterator
from typing import Final, NamedTuple, cast

from tega.devices.base import TactileFrame, TactileSource
from tega.loop.inbox.frames import UNWATCHED, FrameMeter, FrameWatch, measured_contacts
from tega.loop.inbox.inputs import Finger
from tega.loop.inbox.reader import READ_TIMEOUT_S, ReadAhead
from tega.loop.touch import STALE_NS
from tega.records import Contact
from tega.stages.base import Metric

# Pictures that are decoded before their turn, for each finger.
_AHEAD: Final = 8


class Touching:
    """Knows which fingers bear a load while each is measured by a thread of its own.

    It depends on how far these are, and is recorded with each picture, so that a replay measures alike.
    """

    def __init__(self) -> None:
        self._since_ns: dict[str, int] = {}

    def note(self, finger: str, t_ns: int, *, bears_load: bool) -> None:
        """Note whether a finger bears a load, from its frame at a given time."""
        if bears_load:
            self._since_ns[finger] = t_ns
        else:
            self._since_ns.pop(finger, None)

    def beside(self, finger: str, t_ns: int) -> bool:
        """Return whether another finger bears a load by a picture that is not older than 100 ms at a time."""
        others = tuple(self._since_ns.items())  # threads note meanwhile
        return any(other != finger and t_ns - seen_ns <= STALE_NS for other, seen_ns in others)


class _Found(NamedTuple):
    """Measurement of a finger; without a contact the finger's recording ends, at a time."""

    finger: str
    contact: Contact | None
    end_ns: int = 0


class RecordedFingers:
    """Measures the recordings of several fingers in the order of their pictures' times.

    Every finger's metric gets the loads of the others up to that time, as in a live run, so the same recordings give
    the same contacts. Each recording is read by a thread of its own, a few frames ahead.
    """

    def __init__(self) -> None:
        self._touching = Touching()
        self._pictures: dict[str, _TimedPictures] = {}
        self._contacts: dict[str, Generator[Contact, None, int]] = {}
        self._waiting: dict[str, deque[Contact]] = {}
        self._ends_ns: dict[str, int] = {}
        self._read: ReadAhead[_Found] | None = None

    def add(self, name: str, finger: Finger, metric: Metric, watch: FrameWatch = UNWATCHED) -> None:
        """Add a finger whose source is not live; its metric is ``loaded`` or not when ``watch`` observes a frame."""

        def measure_beside(frame: TactileFrame) -> None:
            metric.loaded = self._touching.beside(name, frame.t_ns)

        def notify_others(frame: TactileFrame, contact: Contact) -> None:
            self._touching.note(name, contact.t_ns, bears_load=metric.bears_load)
            watch.notify(frame, contact)

        self._pictures[name] = pictures = _TimedPictures(name, finger.source)
        self._waiting[name] = deque()
        self._contacts[name] = measured_contacts(
            cast("TactileSource", pictures),  # what is not live is not opened again
            FrameMeter(finger.baseline, metric, finger.report, live=False),
            watch._replace(prepare=measure_beside, notify=notify_others),
        )

    def measured(self, stopped: Callable[[], bool]) -> Iterator[_Found]:
        """Measure all pictures in the order of their times; ``RecordingError`` for one that cannot be."""
        left = dict(self._contacts)
        while left and not stopped():
            name = min(left, key=lambda finger: self._pictures[finger].next_ns())
            try:
                yield _Found(name, next(left[name]))
            except StopIteration as stop:
                del left[name]
                yield _Found(name, None, stop.value)

    def contacts(self, name: str) -> Generator[Contact, None, int]:
        """Yield a finger's contacts, measured ahead by another thread; return when its recording ended, nanoseconds."""
        waiting = self._waiting[name]
        while True:
            while not waiting and name not in self._ends_ns:
                self._read = self._read or ReadAhead("recordings", self.measured)
                found = next(self._read)
                if found.contact is None:
                    self._ends_ns[found.finger] = found.end_ns
                else:
                    self._waiting[found.finger].append(found.contact)
            if not waiting:
                return self._ends_ns[name]
            yield waiting.popleft()

    def close(self) -> None:
        """Stop all threads: first the one that waits for the others."""
        if self._read is not None:
            self._read.close()
        for pictures in self._pictures.values():
            pictures.close()


class _TimedPictures:
    """A recording's pictures, of which the next one's time is known before it is measured."""

    def __init__(self, name: str, source: TactileSource) -> None:
        self.info = source.info

        def frames(stopped: Callable[[], bool]) -> Iterator[TactileFrame]:
            while not (stopped() or source.ended):
                if (frame := source.read(READ_TIMEOUT_S)) is not None:
                    yield frame

        self._frames = ReadAhead(name, frames, capacity=_AHEAD)
        self._next: TactileFrame | None = None
        self._over = False

    @property
    def ended(self) -> bool:
        self._check()
        return self._over

    def next_ns(self) -> int:
        """Return when the next picture was taken; of a recording that is over, before all others."""
        self._check()
        return -1 if self._next is None else self._next.t_ns

    def read(self, _timeout_s: float) -> TactileFrame | None:
        self._check()
        frame, self._next = self._next, None
        return frame

    def close(self) -> None:
        self._frames.close()

    def _check(self) -> None:
        if self._next is None and not self._over:
            self._next = next(self._frames, None)
            self._over = self._next is None
