"""Read a device or a recording in a thread of its own, and open a live one again that went away."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import nullcontext
from typing import Any, Generic, NamedTuple, TypeVar

from tega.errors import TegaError
from tega.runtime.reopening import Reopening, polled
from tega.runtime.threads import Rank, run_realtime

# How long a live source may keep its thread from noticing that the run is over.
READ_TIMEOUT_S = 0.1

# Between two tries to open a live source that went away.
REOPEN_S = 1.0

Given = TypeVar("Given")
Produce = Callable[[Callable[[], bool]], Iterable[Given]]
"""Creates the iterator, in the thread; its argument is a function that returns true to stop."""


class Reader(Generic[Given]):
    """A thread that calls ``take`` with the items of an iterator, then ``done`` with its return value and exception."""

    def __init__(
        self,
        name: str,
        produce: Produce[Given],
        take: Callable[[Given], None],
        done: Callable[[int | None, BaseException | None], None] = lambda _end_ns, _error: None,
        *,
        rank: Rank | None = None,
    ) -> None:
        self._produce, self._take, self._done = produce, take, done
        self._rank, self._stop = rank, threading.Event()
        self._thread = threading.Thread(target=self._work, name=f"tega-{name}", daemon=True)
        self._thread.start()

    def _work(self) -> None:
        end_ns, error = None, None
        try:
            with run_realtime(self._rank) if self._rank else nullcontext():
                end_ns = self._pass_on(iter(self._produce(self._stop.is_set)))
        except BaseException as raised:  # carried to the function that is called at the end
            error = raised
        self._done(end_ns, error)

    def _pass_on(self, items: Iterator[Given]) -> int | None:
        while not self._stop.is_set():
            try:
                item = next(items)
            except StopIteration as stop:
                end_ns: int | None = stop.value
                return end_ns
            self._take(item)
        return None

    def close(self) -> None:
        """Stop the thread and wait for it."""
        self._stop.set()
        self._thread.join(timeout=5.0)


class _End(NamedTuple):
    end_ns: int | None
    error: BaseException | None


class ReadAhead(Generic[Given]):
    """Items of a recording, in order, of a thread that reads a little ahead; an exception comes after them."""

    def __init__(self, name: str, produce: Produce[Given], *, capacity: int = 64) -> None:
        self._waiting: queue.Queue[Given | _End] = queue.Queue(capacity)
        self._leaving = threading.Event()
        self._end: _End | None = None
        self._reader: Reader[Given] = Reader(
            name, produce, self._put, lambda end_ns, error: self._put(_End(end_ns, error))
        )

    def _put(self, item: Given | _End) -> None:
        while not self._leaving.is_set():
            try:
                self._waiting.put(item, timeout=READ_TIMEOUT_S)
            except queue.Full:
                continue
            return

    def __iter__(self) -> Iterator[Given]:
        """Return itself."""
        return self

    def __next__(self) -> Given:
        """Return the next item, and wait for it."""
        if self._end is None:
            got = self._waiting.get()
            if not isinstance(got, _End):
                return got
            self._end = got
            if got.error is not None:
                raise got.error
        raise StopIteration(self._end.end_ns)

    def close(self) -> None:
        """Stop the thread and wait for it."""
        self._leaving.set()
        self._reader.close()


def read_items(source: Any, stopped: Callable[[], bool]) -> Iterator[Any]:
    """Yield the items of a source until it is stopped."""
    while not stopped():
        if (item := source.read(READ_TIMEOUT_S)) is not None:
            yield item


def opened_again(device: Any, stopped: Callable[[], bool]) -> bool:
    """Open a live device that went away, once a second until that works; return whether it is there."""
    again = Reopening(READ_TIMEOUT_S, REOPEN_S, factor=REOPEN_S / READ_TIMEOUT_S)

    def opened() -> bool:
        device.open()
        return True

    return bool(again.open(opened, polled(stopped, every_s=READ_TIMEOUT_S), absent=TegaError))
