"""Give the loop what it received in a recorded run, at the ticks at which it did."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from heapq import heappop, heappush
from typing import TYPE_CHECKING, Generic, TypeVar

from tega.loop.inbox.stream import NEVER_NS, LiveStream
from tega.loop.pacing import Pacer
from tega.records import Contact, Intent, Skip
from tega.runtime.clock import ManualClock

if TYPE_CHECKING:
    from tega.recording.replay.feed import RecordFeed

Taken = TypeVar("Taken", Contact, Intent)

_SETTLE_NS = 1_000_000_000
# More than come in one tick after the longest standstill.
_MOST = 1 << 20


class RecordedPacer(Pacer):
    """Leaves out the deadlines that were left out, wakes where the loop was woken, and knows when the run was over.

    Args:
        feed: The recording; it is read as far as each deadline needs it.
        settle: Called about every second with the tick.

    Attributes:
        fills: Functions that put the run's input into its streams, called with a tick that has any, and at the end.
    """

    def __init__(self, feed: RecordFeed, settle: Callable[[int], None]) -> None:
        super().__init__(ManualClock())
        self._feed, self._settle = feed, settle
        self._skipped: set[int] = set()
        self._turns_ns: list[int] = []
        self._settled_ns = 0
        self.tick_ns = -1
        self.fills: list[Callable[[int], None]] = []
        feed.bus.subscribe(Skip, lambda skip: self._skipped.add(skip.t_ns), vital=True)
        feed.bus.subscribe(Contact, self._note_turn, vital=True)
        feed.bus.subscribe(Intent, self._note_turn, vital=True)

    def _note_turn(self, record: Contact | Intent) -> None:
        heappush(self._turns_ns, record.taken_ns)

    def doze(self, t_ns: int) -> int:
        """Return when the loop was woken, or the deadline."""
        self._feed.read_until(t_ns)
        if not self._turns_ns or self._turns_ns[0] >= t_ns:
            return t_ns
        self._reach(self._turns_ns[0])
        return self.tick_ns

    def wait(self, t_ns: int) -> bool:
        """Go to a deadline; return whether its tick was carried out."""
        self._feed.read_until(t_ns)
        self.n_waits += 1
        self._reach(t_ns)
        if t_ns - self._settled_ns > _SETTLE_NS:
            self._settled_ns = t_ns
            self._settle(t_ns)
        if t_ns in self._skipped:
            self._skipped.remove(t_ns)
            return False
        return True

    def _reach(self, t_ns: int) -> None:
        self.tick_ns = t_ns
        turns, any_due = self._turns_ns, False
        while turns and turns[0] <= t_ns:
            heappop(turns)
            any_due = True
        end = self._feed.end
        # The last look of a set time is before its end, and takes in what came until then.
        last = end is not None and end.ended == "duration" and t_ns >= end.end_ns
        if any_due or last or self.over():
            for fill in self.fills:
                fill(NEVER_NS if last else t_ns)

    def over(self) -> bool:
        """Return whether the run was over."""
        end = self._feed.end
        if end is None:
            return self._feed.ended and self.tick_ns >= self._feed.last_tick_ns and self.n_waits > 0
        return self.n_waits >= end.n_waits and not self._turns_ns


class TakenItems(Generic[Taken]):
    """Puts each item of a recorded stream into a live one at the tick at which the run received it.

    If every source had ended, the stream ends with the last tick of the run.

    Args:
        feed: The recording.
        pacer: Ticks of the run.
        item: Returns what a recorded item is now; ``None`` for one that is left out.

    Attributes:
        stream: The loop's input.
        rows: Recorded items that are not put in yet.
    """

    def __init__(self, feed: RecordFeed, pacer: RecordedPacer, item: Callable[[Taken], Taken | None]) -> None:
        self._feed, self._pacer = feed, pacer
        self._item: Callable[[Taken], Taken | None] = item
        self.rows: deque[Taken] = deque()
        self.stream: LiveStream[Taken] = LiveStream(capacity=_MOST)
        pacer.fills.append(self.fill)

    def fill(self, t_ns: int) -> None:
        """Put in the items taken up to a tick."""
        while self.rows and self.rows[0].taken_ns <= t_ns:
            item = self._item(self.rows.popleft())
            if item is not None:
                self.stream.put(item)
        end = self._feed.end
        if end is not None and end.ended == "complete" and not self.rows and self._pacer.over():
            self.stream.end(end.end_ns)
