"""Give a loop its items, computed on demand or put in by another thread: records in rising order of their ``t_ns``."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from typing import Generic, Protocol, TypeVar

NEVER_NS = 2**63 - 1


class StampedRecord(Protocol):
    """A record with a time, such as :class:`tega.records.Contact` or :class:`tega.records.Intent`."""

    @property
    def t_ns(self) -> int:
        """Time since the start of the session, nanoseconds."""


Item = TypeVar("Item", bound=StampedRecord)
Item_co = TypeVar("Item_co", bound=StampedRecord, covariant=True)


class Stream(Protocol[Item_co]):
    """A stream of items that the loop takes its input from."""

    @property
    def ended(self) -> bool:
        """Whether nothing will come any more."""

    @property
    def end_ns(self) -> int:
        """Time at which the stream ends, if it is known."""

    @property
    def due_ns(self) -> int:
        """Before this time there is nothing to give."""

    def next_until(self, t_ns: int) -> Item_co | None:
        """Return the next item known at ``t_ns``, or ``None`` when there is none (yet)."""


class PulledStream(Generic[Item]):
    """A stream of items that exist already or are computed on demand.

    It ends at the latest of its last item's time, ``end_ns`` and the time that the iterator may return.
    """

    def __init__(self, items: Iterable[Item], *, end_ns: int = 0) -> None:
        self._items = iter(items)
        self._head: Item | None = None
        self._begun = self.ended = False
        self.end_ns = end_ns
        self.due_ns = 0

    def _advance(self) -> None:
        try:
            self._head = head = next(self._items)
        except StopIteration as stop:
            self._head, self.ended, self.due_ns = None, True, NEVER_NS
            self.end_ns = max(self.end_ns, stop.value or 0)
        else:
            self.due_ns = head.t_ns
            self.end_ns = max(self.end_ns, head.t_ns)

    def next_until(self, t_ns: int) -> Item | None:
        """Return the next item known at ``t_ns``, or ``None``; raises whatever the iterator raises."""
        if not self._begun:
            self._begun = True
            self._advance()
        if self.due_ns > t_ns:
            return None
        head = self._head
        self._advance()
        return head


class LiveStream(Generic[Item]):
    """A stream filled by another thread, the link, or the driver of the loop's time; the loop never waits.

    At most ``capacity`` items are held; where the loop does not keep up, the oldest are lost. Nothing is put
    in before ``due_ns``; ``clock`` returns the monotonic time by which items lapse.

    Attributes:
        on_loss: Called for every item that was not taken in time, in the thread that finds out.
        on_item: Called when an item can be taken, in the thread that put it in.
    """

    def __init__(
        self,
        *,
        capacity: int = 64,
        due_ns: int = 0,
        clock: Callable[[], int] = time.monotonic_ns,
        on_loss: Callable[[], None] = lambda: None,
        on_item: Callable[[], None] = lambda: None,
    ) -> None:
        self._items: deque[tuple[Item, int]] = deque()
        self._lock = threading.Lock()
        self._capacity, self._clock = capacity, clock
        self._next_ns = due_ns
        self._stopped = False
        self._error: BaseException | None = None
        self.on_loss, self.on_item = on_loss, on_item
        self.ended = False
        self.end_ns = 0

    @property
    def due_ns(self) -> int:
        """Before this time there is nothing to give."""
        nothing_ns = NEVER_NS if self.ended else self._next_ns
        try:
            return self._items[0][0].t_ns if self._items else nothing_ns
        except IndexError:  # closed meanwhile
            return nothing_ns

    def put(self, item: Item, *, use_by_ns: int = NEVER_NS, next_ns: int = 0) -> None:
        """Add an item, to be taken until ``use_by_ns`` on the stream's clock; none comes before ``next_ns``."""
        with self._lock:
            lost = len(self._items) >= self._capacity
            if lost:
                self._items.popleft()
            self._items.append((item, use_by_ns))
            self._next_ns = next_ns
            self.end_ns = max(self.end_ns, item.t_ns)
        if lost:
            self.on_loss()
        self.on_item()

    def end(self, end_ns: int | None = None, error: BaseException | None = None) -> None:
        """End the stream at ``end_ns`` or its last item; ``error`` is raised to the loop after the items before it."""
        with self._lock:
            self.end_ns = max(self.end_ns, end_ns or 0)
            self._error = error
            self._next_ns, self._stopped = 0, True

    def next_until(self, t_ns: int) -> Item | None:
        """Return the next item stamped by ``t_ns`` that has not lapsed, or ``None``; raises the stream's error."""
        while self._items:  # without the lock: there is mostly nothing
            with self._lock:
                if not self._items or self._items[0][0].t_ns > t_ns:
                    return None
                item, use_by_ns = self._items.popleft()
            if use_by_ns == NEVER_NS or self._clock() <= use_by_ns:
                return item
            self.on_loss()
        if self._stopped and not self._items:
            self.ended = True
            if (error := self._error) is not None:
                self._error = None
                raise error
        return None

    def close(self) -> None:
        """Discard the remaining items, and accept no more."""
        with self._lock:
            self._items.clear()
            self._stopped = self.ended = True
