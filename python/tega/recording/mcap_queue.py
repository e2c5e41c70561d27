"""Queue records between producers and the writing thread: bounded; records that do not fit are counted."""

from __future__ import annotations

import threading
import time
from collections import Counter, deque
from typing import NamedTuple, Self

from tega.records import Picture, Record
from tega.records.base import VideoPacket
from tega.records.bus import report_drops

__all__ = ["BoundedQueue", "Item"]

# Small records still find room when pictures have filled the queue: without them nothing could be replayed.
RESERVE_BYTES = 16 * 1024 * 1024
_WAIT_S = 0.002
# A record costs this in memory besides its numbers.
_ITEM_BYTES = 512


class Item(NamedTuple):
    """A record to be written, not yet encoded.

    ``t_ns`` is its arrival since the start of the session; ``n_bytes`` is about its size in memory.
    """

    record: Record
    t_ns: int
    n_bytes: int

    @classmethod
    def of(cls, record: Record, t_ns: int | None) -> Self:
        """Make the item of a record, which came at the time of its own stamp unless another is given."""
        return cls(record, record.log_ns if t_ns is None else t_ns, record.n_bytes + _ITEM_BYTES)


class BoundedQueue:
    """First in, first out, up to so many bytes; given by many threads, taken by one.

    The consumer holds no lock: its thread has the lowest priority in the program, and the producers would
    wait for it. Beyond ``most_bytes`` pictures are dropped and counted, everything else 16 MiB later; with
    ``wait`` producers wait instead, for runs that are not in real time.
    """

    def __init__(self, *, most_bytes: int, wait: bool = False) -> None:
        self._most_bytes = most_bytes
        self._wait = wait
        self._items: deque[Item] = deque()
        self._lock = threading.Lock()
        self._closed = False
        self._given_bytes = 0
        self._done_bytes = 0
        self.dropped: Counter[str] = Counter()
        self._dropped_at_s = 0.0

    def __len__(self) -> int:
        """Return how many wait."""
        return len(self._items)

    @property
    def n_bytes(self) -> int:
        """Memory that the items take, bytes."""
        return self._given_bytes - self._done_bytes

    def put(self, item: Item) -> bool:
        """Add an item; return at once (unless ``wait`` is set) whether there was room."""
        limit = (
            self._most_bytes
            if isinstance(item.record, Picture | VideoPacket)
            else self._most_bytes + RESERVE_BYTES
        )
        while True:
            with self._lock:
                if self._closed:
                    self._drop(item)
                    return False
                # One item always fits, however large it is.
                if self.n_bytes == 0 or self.n_bytes + item.n_bytes <= limit:
                    self._given_bytes += item.n_bytes
                    self._items.append(item)
                    return True
                if not self._wait:
                    self._drop(item)
                    return False
            time.sleep(_WAIT_S)

    def take(self) -> Item | None:
        """Return the oldest item, ``None`` when there is none; its bytes count until :meth:`done`."""
        try:
            return self._items.popleft()
        except IndexError:
            return None

    def done(self, item: Item) -> None:
        """Free an item's room; called by the consumer."""
        self._done_bytes += item.n_bytes

    def problem(self) -> str:
        """Return how many were dropped while that goes on, ``""`` once no more are."""
        dropped = report_drops(self.dropped.total(), self._dropped_at_s)
        return f"{dropped}: disk or processor does not keep up" if dropped else ""

    def close(self) -> None:
        """Accept no more items: new ones count as dropped, waiting ones can still be taken."""
        with self._lock:
            self._closed = True

    def discard(self) -> None:
        """Count everything that waits as dropped."""
        while (item := self.take()) is not None:
            self.dropped[item.record.where] += 1
            with self._lock:
                self._given_bytes -= item.n_bytes

    def _drop(self, item: Item) -> None:
        self.dropped[item.record.where] += 1
        self._dropped_at_s = time.monotonic()
