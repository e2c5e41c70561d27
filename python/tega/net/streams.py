"""A stream of the loop that is filled by the link."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Generic

from tega.teleop.streams import Item

__all__ = ["InboxStream"]

_CAPACITY = 64


class InboxStream(Generic[Item]):
    """What came over the link and was not taken yet; it never ends, and the loop never waits for it.

    Args:
        on_loss: Called for every item that was not taken in time.
        capacity: Items held at most; the oldest are lost.
    """

    def __init__(self, *, on_loss: Callable[[], None] = lambda: None, capacity: int = _CAPACITY) -> None:
        self._items: deque[Item] = deque()
        self._on_loss, self._capacity = on_loss, capacity
        self.ended = False
        self.end_ns = 0
        self.due_ns = 0

    def put(self, item: Item) -> None:
        """Add an item; in a thread of the link's."""
        if len(self._items) >= self._capacity:
            self._items.popleft()
            self._on_loss()
        self._items.append(item)
        self.end_ns = item[0]

    def next_until(self, t_ns: int) -> Item | None:
        """Return the next item stamped at or before ``t_ns``, or ``None`` when there is none yet."""
        if not self._items or self._items[0][0] > t_ns:
            return None
        try:
            return self._items.popleft()
        except IndexError:  # lost just now
            return None

    def close(self) -> None:
        """Take no more."""
        self._items.clear()
        self.ended = True
