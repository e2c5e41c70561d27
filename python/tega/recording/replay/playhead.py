"""Move to another moment of a recording while it is played; the run's own time goes on."""

from __future__ import annotations

import threading
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Sequence
from typing import Generic

from msgspec.structs import replace

from tega.errors import InvalidValueError
from tega.loop.inbox.stream import Item, LiveStream

__all__ = ["PlayedItems", "Playhead"]


class Playhead:
    """Says which moment of a recording is played now, and takes wishes for another.

    Clock, budgets and limits of the run stay those of the run: a jump shortens no pause.

    Args:
        from_s: Position to begin at, seconds since the beginning of the recording.

    Attributes:
        end_ns: Length of the recording; 0 until it is read.
        shift_ns: Time of the run minus time of the recording.
        n_jumps: Wishes taken up so far.
        fills: Functions called with every tick of the run, after a requested jump.

    Raises:
        InvalidValueError: ``from_s`` is below 0.
    """

    def __init__(self, from_s: float = 0.0) -> None:
        if not from_s >= 0:
            raise InvalidValueError(f"from = {from_s:g} s, expected 0 or more")
        self.from_ns = round(from_s * 1e9)
        self.end_ns = self.shift_ns = self.n_jumps = 0
        self.fills: list[Callable[[int], None]] = []
        self._lock = threading.Lock()
        self._wanted_ns: int | None = None
        self._reached_ns = 0

    def begin(self, end_ns: int, lead_ns: int) -> None:
        """Take note of the recording, which the run's time before ``lead_ns`` is without.

        Raises:
            InvalidValueError: The recording ends before the moment to begin with.
        """
        if self.from_ns >= max(end_ns, 1):
            raise InvalidValueError(
                f"from = {self.from_ns / 1e9:g} s, and the recording has {end_ns / 1e9:.1f} s",
                "begin earlier",
            )
        self.end_ns, self.shift_ns = end_ns, lead_ns - self.from_ns

    @property
    def duration_s(self) -> float:
        """Length of the recording, seconds; 0 until it is read."""
        return self.end_ns / 1e9

    @property
    def at_s(self) -> float:
        """The moment of the recording that is played now, seconds."""
        return (
            min(max(self._reached_ns - self.shift_ns, self.from_ns if not self.n_jumps else 0), self.end_ns)
            / 1e9
        )

    @property
    def wanted(self) -> bool:
        """Whether a wish waits."""
        return self._wanted_ns is not None

    def go_to(self, t_s: float) -> None:
        """Ask for a moment of the recording, seconds; of two wishes the newer one counts. From any thread."""
        with self._lock:
            self._wanted_ns = min(max(round(t_s * 1e9), 0), self.end_ns)

    def reach(self, t_ns: int) -> None:
        """Take up a wish at a time of the run, and have the streams filled up to it."""
        self._reached_ns = t_ns
        with self._lock:
            wanted_ns, self._wanted_ns = self._wanted_ns, None
        if wanted_ns is not None:
            self.shift_ns = t_ns - wanted_ns
            self.n_jumps += 1
        for fill in self.fills:
            fill(t_ns)


class PlayedItems(Generic[Item]):
    """Puts the items of a recording into a live stream of the loop, from wherever the playhead is.

    Args:
        items: Items, stamped with the recording's time.
        known: Time at which each item was known, in rising order.
        playhead: Position of the playback; fills the stream at every tick of the run.
        first: Item in force before the first one; at a jump the item in force at the new position is repeated.
            ``None`` for items without later effect.

    Attributes:
        stream: Stream for the loop.
    """

    def __init__(
        self,
        items: Sequence[Item],
        known: Sequence[int],
        *,
        playhead: Playhead,
        first: Item | None = None,
    ) -> None:
        self._items, self._known, self._playhead = items, known, playhead
        self._first = first
        self._next = bisect_left(known, playhead.from_ns)
        self._n_jumps = playhead.n_jumps
        self._standing = self._at(self._next - 1)
        self._newest_ns = -1
        self.stream: LiveStream[Item] = LiveStream(capacity=len(items) + 1)
        playhead.fills.append(self.fill)

    def _at(self, place: int) -> Item | None:
        if self._first is None:
            return None
        return self._first if place < 0 else self._items[place]

    def fill(self, t_ns: int) -> None:
        """Put in the items known at a time of the run; end the stream at the end of the recording."""
        playhead = self._playhead
        if self._n_jumps != playhead.n_jumps:
            self._n_jumps = playhead.n_jumps
            self._next = bisect_right(self._known, t_ns - playhead.shift_ns)
            self._standing = self._at(self._next - 1)
        if self._standing is not None:
            self._put(self._standing, t_ns)
            self._standing = None
        while self._next < len(self._items) and self._known[self._next] + playhead.shift_ns <= t_ns:
            item = self._items[self._next]
            self._next += 1
            self._put(item, item.t_ns + playhead.shift_ns)
        end_ns = playhead.shift_ns + playhead.end_ns
        if t_ns >= end_ns:
            self.stream.end(end_ns)

    def _put(self, item: Item, t_ns: int) -> None:
        # Of two moments on either side of a jump the later one may be stamped earlier.
        self._newest_ns = max(t_ns, self._newest_ns + 1)
        self.stream.put(replace(item, t_ns=self._newest_ns))  # type: ignore[type-var]  # a record, which is a struct
