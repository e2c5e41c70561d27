"""Give the loop what it received in a recorded run, at the ticks at which it did."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from heapq import heappop, heappush
from typing import TYPE_CHECKING, Generic, TypeVar

from tega.loop.inbox.stream import NEVER_NS
from tega.loop.pacing import Pacer
from tega.records import Contact, Intent, Skip
from tega.runtime.clock import ManualClock

if TYPE_CHECKING:
    from tega.recording.replay.feed import RecordFeed

Taken = TypeVar("Taken", Contact, Intent)

_SETTLE_NS = 1_000_000_000


class RecordedPacer(Pacer):
    """Leaves out the deadlines that were left out, wakes where the loop was woken, and knows when the run was over.

    Args:
        feed: The recording; it is read as far as each deadline needs it.
        settle: Called about every second with the tick.
    """

    def __init__(self, feed: RecordFeed, settle: Callable[[int], None]) -> None:
        super().__init__(ManualClock())
        self._feed, self._settle = feed, settle
        self._skipped: set[int] = set()
        self._turns_ns: list[int] = []
        self._settled_ns = 0
        self.tick_ns = -1
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
        self._reach(t_ns)
        self.n_waits += 1
        if t_ns - self._settled_ns > _SETTLE_NS:
            self._settled_ns = t_ns
            self._settle(t_ns)
        if t_ns in self._skipped:
            self._skipped.remove(t_ns)
            return False
        return True

    def _reach(self, t_ns: int) -> None:
        self.tick_ns = t_ns
        while self._turns_ns and self._turns_ns[0] <= t_ns:
            heappop(self._turns_ns)

    def over(self) -> bool:
        """Return whether the run was over."""
        end = self._feed.end
        if end is None:
            return self._feed.ended and self.tick_ns >= self._feed.last_tick_ns and self.n_waits > 0
        return self.n_waits >= end.n_waits and not self._turns_ns


class TakenStream(Generic[Taken]):
    """A stream with each item at the tick at which the run received it.

    If every source had ended, the stream ends with the last tick of the run.

    Args:
        feed: The recording.
        pacer: Says when the run was over.
        item: Returns what a recorded item is now; ``None`` for one that is left out.

    Attributes:
        rows: Recorded items that are not taken yet.
    """

    def __init__(self, feed: RecordFeed, pacer: RecordedPacer, item: Callable[[Taken], Taken | None]) -> None:
        self._pacer = pacer
        self._item: Callable[[Taken], Taken | None] = item
        end = feed.end
        # The last look of a set time is before its end.
        self._latest_ns = end.end_ns - 1 if end is not None and end.ended == "duration" else NEVER_NS
        self._ends = end is not None and end.ended == "complete"
        self.end_ns = 0 if end is None else end.end_ns
        self.rows: deque[Taken] = deque()

    @property
    def due_ns(self) -> int:
        """Time of the next item; 0 where none is read yet."""
        if self.rows:
            return min(self.rows[0].taken_ns, self._latest_ns)
        return NEVER_NS if self.ended else 0

    @property
    def ended(self) -> bool:
        """Whether nothing will come any more."""
        return self._ends and not self.rows and self._pacer.over()

    def next_until(self, t_ns: int) -> Taken | None:
        """Return the next item known at a time, or ``None``."""
        while self.rows and self.due_ns <= t_ns:
            item = self._item(self.rows.popleft())
            if item is not None:
                self.end_ns = max(self.end_ns, item.t_ns)
                return item
        return None

    def drain(self) -> None:
        """Pass over the items that the loop did not take."""
        while self.rows:
            self._item(self.rows.popleft())

    def close(self) -> None:
        """Discard nothing: the rest is passed over by :meth:`drain`."""
