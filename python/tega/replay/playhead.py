"""Move to another moment of a recording while it is played: the run's own time goes on, what comes into it changes."""

from __future__ import annotations

import threading
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Sequence
from typing import Generic

from tega.errors import InvalidValueError
from tega.inbox.stream import Item

__all__ = ["PlayedStream", "Playhead"]

# A wish is taken up this soon, also where the recording is silent.
_LOOK_NS = 50_000_000


class Playhead:
    """Says which moment of a recording is played now, and takes wishes for another.

    Clock, budgets and limits of the run stay those of the run: nobody's pause becomes shorter by a jump.

    Args:
        from_s: Where to begin, seconds since the beginning of the recording.

    Attributes:
        end_ns: Length of the recording; 0 until it is read.
        shift_ns: Time of the run minus time of the recording.
        n_jumps: Wishes taken up so far.

    Raises:
        InvalidValueError: ``from_s`` is below 0.
    """

    def __init__(self, from_s: float = 0.0) -> None:
        if not from_s >= 0:
            raise InvalidValueError(f"from = {from_s:g} s, expected 0 or more")
        self.from_ns = round(from_s * 1e9)
        self.end_ns = self.shift_ns = self.n_jumps = 0
        self._lock = threading.Lock()
        self._wanted_ns: int | None = None
        self._reached_ns = 0

    def begin(self, end_ns: int, lead_ns: int) -> None:
        """Take note of the recording, which the run's time before ``lead_ns`` is without.

        Raises:
            InvalidValueError: The recording ends before what it is to begin with.
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
        """Take up a wish at a time of the run."""
        self._reached_ns = t_ns
        if self._wanted_ns is None:
            return
        with self._lock:
            wanted_ns, self._wanted_ns = self._wanted_ns, None
        if wanted_ns is not None:
            self.shift_ns = t_ns - wanted_ns
            self.n_jumps += 1


class PlayedStream(Generic[Item]):
    """A recorded stream of the loop, from wherever the playhead is.

    Args:
        items: What came, stamped with the recording's time.
        known: When each was known then, in rising order.
        playhead: Says what is played.
        stamped: Gives an item another time.
        first: What stands before the first item, and at a jump what stood then is told again; ``None`` for items that
            mean nothing later.
    """

    def __init__(
        self,
        items: Sequence[Item],
        known: Sequence[int],
        *,
        playhead: Playhead,
        stamped: Callable[[Item, int], Item],
        first: Item | None = None,
    ) -> None:
        self._items, self._known, self._playhead, self._stamped = items, known, playhead, stamped
        self._first = first
        self._next = bisect_left(known, playhead.from_ns)
        self._n_jumps = playhead.n_jumps
        self._standing = self._at(self._next - 1)
        self._newest_ns = -1
        self._asked_ns = 0
        self._closed = False

    def _at(self, place: int) -> Item | None:
        if self._first is None:
            return None
        return self._first if place < 0 else self._items[place]

    @property
    def end_ns(self) -> int:
        """When the recording ends, in the run's time."""
        return self._playhead.shift_ns + self._playhead.end_ns

    @property
    def ended(self) -> bool:
        """Whether the recording is over: until then one can go back."""
        return self._closed or (self._asked_ns >= self.end_ns and not self._playhead.wanted)

    @property
    def due_ns(self) -> int:
        """Before this time there is nothing to give."""
        playhead = self._playhead
        if playhead.wanted or self._n_jumps != playhead.n_jumps or self._standing is not None:
            return 0
        due_ns = self.end_ns
        if self._next < len(self._known):
            due_ns = min(due_ns, self._known[self._next] + playhead.shift_ns)
        return min(due_ns, self._asked_ns + _LOOK_NS)

    def next_until(self, t_ns: int) -> Item | None:
        """Return the next item known at ``t_ns``, or ``None``."""
        playhead = self._playhead
        self._asked_ns = t_ns
        playhead.reach(t_ns)
        if self._n_jumps != playhead.n_jumps:
            self._n_jumps = playhead.n_jumps
            self._next = bisect_right(self._known, t_ns - playhead.shift_ns)
            self._standing = self._at(self._next - 1)
        if self._standing is not None:
            standing, self._standing = self._standing, None
            return self._told(standing, t_ns)
        if self._closed or self._next >= len(self._items):
            return None
        if self._known[self._next] + playhead.shift_ns > t_ns:
            return None
        item = self._items[self._next]
        self._next += 1
        return self._told(item, item[0] + playhead.shift_ns)

    def _told(self, item: Item, t_ns: int) -> Item:
        # Of two moments on either side of a jump the later one may be stamped earlier.
        self._newest_ns = max(t_ns, self._newest_ns + 1)
        return self._stamped(item, self._newest_ns)

    def close(self) -> None:
        """Drop what is left."""
        self._closed, self._standing = True, None
