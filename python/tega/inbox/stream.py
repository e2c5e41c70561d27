"""Streams of stamped items for the loop: pulled where waiting costs nothing, read by a thread where it does.

Where the world is a simulated one, a stream is filled in step with the loop.

A stream is made of an iterator whose items are tuples beginning with a time in nanoseconds since the start of
the session, in rising order. Its iterator may return the time at which the stream ends (the last frame lasts
one period); otherwise that is the time of its last item.
"""

from __future__ import annotations

import queue
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import nullcontext
from typing import Any, Generic, Protocol, TypeVar

from tega.priority import ahead_of_others

__all__ = ["NEVER_NS", "Item", "PulledStream", "QueuedStream", "Stream", "ThreadedStream"]

NEVER_NS = 2**63 - 1

Item = TypeVar("Item", bound=tuple[Any, ...])
Item_co = TypeVar("Item_co", bound=tuple[Any, ...], covariant=True)


class Stream(Protocol[Item_co]):
    """What the loop takes its input from.

    Attributes:
        ended: Whether nothing will come any more.
        end_ns: When the stream ends, as far as is known.
        due_ns: Before this time :meth:`next_until` has nothing to give.
    """

    ended: bool
    end_ns: int
    due_ns: int

    def next_until(self, t_ns: int) -> Item_co | None:
        """Return the next item stamped at or before ``t_ns``, or ``None`` when there is none (yet)."""
        ...

    def close(self) -> None:
        """Stop producing."""
        ...


class PulledStream(Generic[Item]):
    """A stream whose items are computed when they are asked for.

    Args:
        items: The iterator.
        end_ns: When the stream ends, where the iterator does not return it.
    """

    def __init__(self, items: Iterable[Item] | Generator[Item, None, int], *, end_ns: int = 0) -> None:
        self._items = iter(items)
        self._head: Item | None = None
        self.ended = False
        self.end_ns = end_ns
        self.due_ns = 0
        self._advance()

    def _advance(self) -> None:
        try:
            self._head = next(self._items)
        except StopIteration as stop:
            self._head, self.ended, self.due_ns = None, True, NEVER_NS
            if stop.value is not None:
                self.end_ns = max(self.end_ns, stop.value)
        else:
            self.due_ns = self._head[0]
            self.end_ns = max(self.end_ns, self.due_ns)

    def next_until(self, t_ns: int) -> Item | None:
        """Return the next item stamped at or before ``t_ns``, or ``None``."""
        head = self._head
        if head is None or head[0] > t_ns:
            return None
        self._advance()
        return head

    def close(self) -> None:
        """Drop what is left."""
        self._head, self.ended = None, True


class QueuedStream(Generic[Item]):
    """A stream that is filled in step with the loop, by whoever makes the loop's time pass.

    Args:
        due_ns: Before this time nothing will be put in.
    """

    def __init__(self, *, due_ns: int = 0) -> None:
        self._items: deque[Item] = deque()
        self.ended = False
        self.end_ns = 0
        self.due_ns = self._next_ns = due_ns

    def put(self, item: Item, *, next_ns: int) -> None:
        """Add an item.

        Args:
            item: It, with a time not before that of the item before it.
            next_ns: The next one's time, or any before it.
        """
        self._items.append(item)
        self._next_ns = next_ns
        self.due_ns = self._items[0][0]
        self.end_ns = max(self.end_ns, item[0])

    def next_until(self, t_ns: int) -> Item | None:
        """Return the next item stamped at or before ``t_ns``, or ``None``."""
        if self.due_ns > t_ns or not self._items:
            return None
        head = self._items.popleft()
        self.due_ns = self._items[0][0] if self._items else self._next_ns
        return head

    def end(self, t_ns: int) -> None:
        """Put an end to the stream, and drop what was not taken."""
        self._items.clear()
        self.ended, self.end_ns, self.due_ns = True, t_ns, NEVER_NS

    def close(self) -> None:
        """Drop what is left."""
        self.end(self.end_ns)


class _End:
    def __init__(self, end_ns: int | None, error: BaseException | None) -> None:
        self.end_ns = end_ns
        self.error = error


class ThreadedStream(Generic[Item]):
    """A stream whose items are made by a thread of its own.

    Of a recording every item arrives, in order: the thread waits when it is far ahead, the loop waits until it
    knows what comes next. Of a live device the loop never waits, and when it does not keep up the oldest items
    are lost and counted. An error in the thread is raised in the loop, after the items made before it.

    Args:
        name: For the thread.
        produce: Makes the iterator; called in the thread with a function that tells when to stop.
        live: Whether the source runs on its own clock.
        on_loss: Called in the thread for every item lost.
        on_item: Called in the thread when an item can be taken.
        capacity: Items held at most.
    """

    def __init__(
        self,
        name: str,
        produce: Callable[[Callable[[], bool]], Iterable[Item]],
        *,
        live: bool,
        on_loss: Callable[[], None] = lambda: None,
        on_item: Callable[[], None] = lambda: None,
        capacity: int = 64,
    ) -> None:
        self._produce = produce
        self._live = live
        self._on_loss = on_loss
        self._on_item = on_item
        self._queue: queue.Queue[Item | _End] = queue.Queue(capacity)
        self._stop = threading.Event()
        self._head: Item | None = None
        self.ended = False
        self.end_ns = 0
        self.due_ns = 0
        self._thread = threading.Thread(target=self._work, name=f"tega-{name}", daemon=True)
        self._thread.start()

    def _work(self) -> None:
        end_ns, error = None, None
        try:
            with ahead_of_others("measure") if self._live else nullcontext():
                end_ns = self._pass_on(iter(self._produce(self._stop.is_set)))
        except BaseException as raised:  # carried to the loop, which raises it
            error = raised
        self._put(_End(end_ns, error))

    def _pass_on(self, items: Iterator[Item]) -> int | None:
        while not self._stop.is_set():
            try:
                item = next(items)
            except StopIteration as stop:
                end_ns: int | None = stop.value
                return end_ns
            self._put(item)
            self._on_item()
        return None

    def _put(self, item: Item | _End) -> None:
        while not self._stop.is_set():
            try:
                self._queue.put(item, timeout=0.0 if self._live else 0.1)
            except queue.Full:
                if self._live:
                    self._lose_oldest()
            else:
                return

    def _lose_oldest(self) -> None:
        try:
            self._queue.get_nowait()
        except queue.Empty:
            return
        self._on_loss()

    def next_until(self, t_ns: int) -> Item | None:
        """Return the next item stamped at or before ``t_ns``, or ``None`` when there is none (yet).

        Raises:
            BaseException: Whatever stopped the thread.
        """
        if self._head is None and not self.ended:
            self._fetch()
        head = self._head
        if head is None or head[0] > t_ns:
            return None
        self._head = None
        if not self._live:
            # What follows decides whether the recording is over, which the loop has to know by now.
            self._fetch()
        return head

    def _fetch(self) -> None:
        if self._live and not self._queue.queue:
            return  # as it mostly is; the queue's own way of saying so takes a lock and an exception
        try:
            got = self._queue.get(block=not self._live)
        except queue.Empty:
            return
        if isinstance(got, _End):
            self.ended, self.due_ns = True, NEVER_NS
            if got.end_ns is not None:
                self.end_ns = max(self.end_ns, got.end_ns)
            if got.error is not None:
                raise got.error
        else:
            self._head = got
            self.due_ns = 0 if self._live else got[0]
            self.end_ns = max(self.end_ns, got[0])

    def close(self) -> None:
        """Stop the thread and wait for it."""
        self._stop.set()
        self._thread.join(timeout=5.0)
        self.ended = True
