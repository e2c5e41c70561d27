"""A stream of the loop that is filled by the link."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Generic

from tega.inbox.stream import NEVER_NS, Item

__all__ = ["InboxStream"]

_CAPACITY = 64


class InboxStream(Generic[Item]):
    """What came over the link and was not taken yet; it never ends, and the loop never waits for it.

    Args:
        capacity: Items held at most; the oldest are lost.
        clock: Returns our monotonic time, by which items lapse.

    Attributes:
        on_loss: Called for every item that was not taken in time.
    """

    def __init__(self, *, capacity: int = _CAPACITY, clock: Callable[[], int] = time.monotonic_ns) -> None:
        self._items: deque[tuple[Item, int]] = deque()
        self._capacity, self._clock = capacity, clock
        self.on_loss: Callable[[], None] = lambda: None
        self.ended = False
        self.end_ns = 0
        self.due_ns = 0

    def put(self, item: Item, *, use_by_ns: int = NEVER_NS) -> None:
        """Add an item that may be taken until some time of our clock; in a thread of the link's."""
        if len(self._items) >= self._capacity:
            self._items.popleft()
            self.on_loss()
        self._items.append((item, use_by_ns))
        self.end_ns = item[0]

    def next_until(self, t_ns: int) -> Item | None:
        """Return the next item stamped at or before ``t_ns``, or ``None`` when there is none yet."""
        try:
            while self._items[0][0][0] <= t_ns:
                item, use_by_ns = self._items.popleft()
                if self._clock() <= use_by_ns:
                    return item
                self.on_loss()
        except IndexError:  # there is none, or it was lost just now
            pass
        return None

    def close(self) -> None:
        """Take no more."""
        self._items.clear()
        self.ended = True
