"""How far apart two machines' monotonic clocks are, from what they ask each other."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

__all__ = ["PING_PERIOD_NS", "WINDOW_NS", "ClockEstimate", "Offset"]

PING_PERIOD_NS = 200_000_000
WINDOW_NS = 10_000_000_000


class Offset(NamedTuple):
    """How far apart two clocks are.

    Attributes:
        offset_ns: Their clock minus ours.
        round_trip_ns: Of the question this is from; the offset is wrong by at most half of it.
    """

    offset_ns: int
    round_trip_ns: int

    def ours(self, theirs_ns: int) -> int:
        """Return our clock's time for one of theirs."""
        return theirs_ns - self.offset_ns


class ClockEstimate:
    """Keeps the question with the shortest way of the last ten seconds.

    A question leaves us at t0, arrives at t1 and is answered at t2 on their clock, and the answer is here at t3. With
    equal ways their clock is ahead by ((t1 - t0) + (t2 - t3))/2; a way that is longer than the other moves this by
    half the difference.

    Args:
        window_ns: How long a question counts.
    """

    def __init__(self, *, window_ns: int = WINDOW_NS) -> None:
        self._window_ns = window_ns
        # Each has a longer way than the one before it, so the first is the best: what a longer one before a shorter
        # one could say is not of interest any more.
        self._kept: deque[tuple[int, Offset]] = deque()

    def add(self, t0_ns: int, t1_ns: int, t2_ns: int, t3_ns: int) -> None:
        """Take in an answer; one whose times contradict each other is not believed."""
        round_trip_ns = (t3_ns - t0_ns) - (t2_ns - t1_ns)
        if t2_ns < t1_ns or round_trip_ns < 0:
            return
        offset = Offset(((t1_ns - t0_ns) + (t2_ns - t3_ns)) // 2, round_trip_ns)
        while self._kept and self._kept[-1][1].round_trip_ns >= round_trip_ns:
            self._kept.pop()
        self._kept.append((t3_ns, offset))

    def best(self, now_ns: int) -> Offset | None:
        """Return the best of the window; ``None`` where there is none."""
        while self._kept and now_ns - self._kept[0][0] > self._window_ns:
            self._kept.popleft()
        return self._kept[0][1] if self._kept else None

    def forget(self) -> None:
        """Begin anew, with another machine."""
        self._kept.clear()
