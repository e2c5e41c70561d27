"""Keep the time of a played recording: the run's clock at its speed, and the position, which a person can move."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from operator import attrgetter
from typing import Generic, TypeVar

from msgspec.structs import replace

from tega.errors import InvalidValueError
from tega.loop.inbox.stream import LiveStream
from tega.records import Contact, Intent, Record
from tega.runtime.clock import SystemClock

Played = TypeVar("Played", bound=Record)
Taken = TypeVar("Taken", bound=Contact | Intent)

_LATE_NS = 3_000_000
_known_ns = attrgetter("log_ns")


class Playhead:
    """Position in a recording, and clock of the run that plays it; takes requests for another position.

    The clock stands at 0 until the first tick is waited for, then runs at the speed. A jump changes neither
    the clock nor budgets and limits of the run, and shortens no pause. ``from_s`` is the position to begin
    at, seconds, not below 0.

    Attributes:
        speed: Seconds of the session a second, set before the run; ``None`` for a clock that never sleeps.
        end_ns: Length of the recording; 0 until it is read.
        shift_ns: Time of the run minus time of the recording.
        tick_ns: Time of the run: the deadline last waited for.
        fills: Functions called with every tick of the run, after a requested jump and before the loop's
            input.
        n_late: Deadlines that were more than 3 ms late, by the machine's clock; ``worst_late_ns`` is the
            most.
    """

    def __init__(self, from_s: float = 0.0) -> None:
        if not from_s >= 0:
            raise InvalidValueError(f"from = {from_s:g} s, expected 0 or more")
        self.speed: float | None = 1.0
        self.from_ns = round(from_s * 1e9)
        self.end_ns = self.shift_ns = self.n_jumps = 0
        self.tick_ns = self.n_late = self.worst_late_ns = 0
        self.fills: list[Callable[[int], None]] = []
        self._machine = SystemClock()
        self._requested_ns = deque[int](maxlen=1)
        self._began_ns: int | None = None

    def begin(self, end_ns: int, lead_ns: int) -> None:
        """Set the length of the recording, which begins at ``lead_ns`` of the run's time.

        ``InvalidValueError`` where it ends before the position to begin at.
        """
        if self.from_ns >= max(end_ns, 1):
            raise InvalidValueError(
                f"from = {self.from_ns / 1e9:g} s, and the recording has {end_ns / 1e9:.1f} s",
                "begin earlier",
            )
        self.end_ns, self.shift_ns = end_ns, lead_ns - self.from_ns

    @property
    def at_ns(self) -> int:
        """Position in the recording at this tick; before its beginning during the lead."""
        return self.tick_ns - self.shift_ns

    @property
    def at_s(self) -> float:
        """Position in the recording, seconds, within its limits."""
        return min(max(self.at_ns, 0 if self.n_jumps else self.from_ns), self.end_ns) / 1e9

    def go_to(self, t_s: float) -> None:
        """Request a position, seconds; of two requests the newer one counts. From any thread."""
        self._requested_ns.append(min(max(round(t_s * 1e9), 0), self.end_ns))

    def now_ns(self) -> int:
        """Return the time of the run in nanoseconds."""
        if self.speed is None or self._began_ns is None:
            return self.tick_ns
        return math.floor((self._machine.now_ns() - self._began_ns) * self.speed)

    def sleep_until(self, t_ns: int) -> None:
        """Sleep until the run has come to ``t_ns``, then go on to it."""
        if self.speed is not None:
            if self._began_ns is None:
                self._began_ns = self._machine.now_ns()
            due_ns = self._began_ns + math.ceil(t_ns / self.speed)
            self._machine.sleep_until(due_ns)
            late_ns = self._machine.now_ns() - due_ns
            self.n_late += late_ns > _LATE_NS
            self.worst_late_ns = max(self.worst_late_ns, late_ns)
        self.reach(max(self.tick_ns, t_ns))

    def reach(self, t_ns: int) -> None:
        """Go on to a time of the run, carry out a requested jump, and have the streams filled."""
        self.tick_ns = t_ns
        if self._requested_ns:
            self.shift_ns = t_ns - self._requested_ns.pop()
            self.n_jumps += 1
        for fill in self.fills:
            fill(t_ns)


class Track(Generic[Played]):
    """Items of a recording, in the order in which they were known, from wherever the playhead is."""

    def __init__(self, items: Sequence[Played], playhead: Playhead) -> None:
        self._items, self._playhead = items, playhead
        self._next, self._n_jumps = bisect_left(items, playhead.from_ns, key=_known_ns), playhead.n_jumps

    def moved(self) -> bool:
        """Follow a jump of the playhead; return whether there was one since the last call."""
        if self._n_jumps == self._playhead.n_jumps:
            return False
        self._n_jumps = self._playhead.n_jumps
        self._next = bisect_right(self._items, self._playhead.at_ns, key=_known_ns)
        return True

    def due(self) -> Iterator[Played]:
        """Yield the items that the playhead has reached since the last call; a jump passes over those between."""
        self.moved()
        at_ns = self._playhead.at_ns
        while self._next < len(self._items) and _known_ns(self._items[self._next]) <= at_ns:
            self._next += 1
            yield self._items[self._next - 1]

    @property
    def newest(self) -> Played | None:
        """The last item that was reached or passed over; ``None`` before the first."""
        return self._items[self._next - 1] if self._next else None

    def at_playhead(self) -> Played | None:
        """Return the item in force at the playhead; ``None`` before the first."""
        deque(self.due(), maxlen=0)
        return self.newest


class PlayedItems(Generic[Taken]):
    """Puts records of a recording, each after the time at which it was known, into a live stream of the loop.

    With ``first``, the item in force before the first one, the item in force at the new position is repeated at a jump;
    without it items have no later effect.
    """

    def __init__(self, items: Sequence[Taken], playhead: Playhead, first: Taken | None = None) -> None:
        self._track = Track(items, playhead)
        self._playhead, self._first, self._newest_ns = playhead, first, -1
        self.stream: LiveStream[Taken] = LiveStream(capacity=len(items) + 1)
        playhead.fills.append(self.fill)

    def fill(self, t_ns: int) -> None:
        """Put in the items known at a time of the run; end the stream at the end of the recording."""
        shift_ns, begins = self._playhead.shift_ns, self._newest_ns < 0
        if (self._track.moved() or begins) and self._first is not None:
            newest = self._track.newest
            self._put(self._first if newest is None else newest, t_ns)
        for item in self._track.due():
            self._put(item, item.t_ns + shift_ns)
        if t_ns >= shift_ns + self._playhead.end_ns:
            self.stream.end(shift_ns + self._playhead.end_ns)

    def _put(self, item: Taken, t_ns: int) -> None:
        # Of two items on either side of a jump the later one may be stamped earlier.
        self._newest_ns = max(t_ns, self._newest_ns + 1)
        self.stream.put(replace(item, t_ns=self._newest_ns))
