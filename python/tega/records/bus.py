"""Deliver the records of a run from publishers to subscribers.

A record is delivered at once, in the order of the subscriptions, in the thread that publishes it: the loop's for all
that the loop does, a source's own for pictures and samples. A subscriber that may be slow takes its records from a
:class:`Backlog`, in a thread of its own.

A failing subscriber is reported and removed; the run goes on.

Example:
    >>> from tega.records.bus import Bus
    >>> from tega.records import RunState
    >>> bus, seen = Bus(), []
    >>> bus.subscribe(RunState, lambda record: seen.append(record.state))
    >>> bus.publish(RunState(t_ns=0, state="active", reason="all devices ready"))
    >>> seen
    ['active']
"""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import msgspec

from tega.errors import TegaError

_LOG = logging.getLogger(__name__)

_DRAIN_S = 10.0
_WAIT_S = 0.01
# An alert of dropped records ends after this; how many there were stays in the recording and in the summary.
DROPS_REPORTED_S = 10.0

Kind = TypeVar("Kind", bound=msgspec.Struct)


@dataclass(slots=True, eq=False)
class _Subscription:
    topic: type[msgspec.Struct]
    function: Callable[[Any], object]
    name: str
    vital: bool
    backlog: Backlog | None
    left_out: bool = False


class Bus:
    """Delivers records to the subscribers of their kind."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._subscriptions: tuple[_Subscription, ...] = ()
        self._of: dict[type[msgspec.Struct], tuple[Callable[[Any], object], ...]] = {}
        self._backlogs: list[Backlog] = []
        self._failed: dict[str, str] = {}

    def subscribe(
        self,
        topic: type[Kind],
        function: Callable[[Kind], object],
        *,
        name: str = "",
        vital: bool = False,
        backlog: Backlog | None = None,
    ) -> None:
        """Have a function called with every record of a kind from now on; it must not change a record.

        A kind includes its subclasses, so :class:`~tega.records.Record` means all kinds with a topic; a kind
        without a topic is delivered only to subscribers of exactly that kind. ``name`` is for error messages.
        If ``vital``, its exceptions are raised in the publisher, as in a computation that steers no hand. Its
        records wait for it in ``backlog``; with ``None`` it is called at once.
        """
        made = _Subscription(topic, function, name or "subscriber", vital=vital, backlog=backlog)
        with self._lock:
            self._subscriptions = (*self._subscriptions, made)
            self._of = {}
            if backlog is not None and backlog not in self._backlogs:
                self._backlogs.append(backlog)
                backlog.start()

    def wants(self, topic: type[msgspec.Struct]) -> bool:
        """Return whether a record of exactly this kind has a subscriber."""
        found = self._of.get(topic)  # asked for every tick and picture
        return bool(self._found(topic) if found is None else found)

    def publish(self, record: msgspec.Struct) -> None:
        """Deliver a record to all subscribers; whatever a vital one raises is raised here."""
        found = self._of.get(type(record))
        for deliver in self._found(type(record)) if found is None else found:
            deliver(record)

    def problem(self) -> str:
        """Return which subscribers are left out or do not keep up, ``""`` while all is well."""
        lost = [text for backlog in self._backlogs if (text := backlog.problem())]
        return "; ".join([*self._failed.values(), *lost])

    def _found(self, kind: type[msgspec.Struct]) -> tuple[Callable[[Any], object], ...]:
        """Return what hands a record of a kind to each of its subscribers, and keep it."""
        with self._lock:
            self._of[kind] = found = tuple(
                self._way_to(s)
                for s in self._subscriptions
                if issubclass(kind, s.topic) and (s.topic is kind or bool(getattr(kind, "topic", None)))
            )
        return found

    def _way_to(self, subscription: _Subscription) -> Callable[[Any], object]:
        if subscription.backlog is not None:
            return partial(subscription.backlog.put, self._deliver, subscription)
        return subscription.function if subscription.vital else partial(self._deliver, subscription)

    def _deliver(self, subscription: _Subscription, record: msgspec.Struct) -> None:
        if subscription.left_out:
            return
        try:
            subscription.function(record)
        except Exception as error:  # an observer must not end what it observes
            text = _words(error)
            with self._lock:
                subscription.left_out = True
                self._subscriptions = tuple(s for s in self._subscriptions if s is not subscription)
                self._of = {}
                first = subscription.name not in self._failed
                self._failed.setdefault(subscription.name, f"{subscription.name}: {text}")
            if first:
                _LOG.warning("%s: %s; the run goes on", subscription.name, text)


def _words(error: Exception) -> str:
    if isinstance(error, TegaError):
        return error.message
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return f"{type(error).__name__}: {error}"


def report_drops(n_dropped: int, newest_s: float) -> str:
    """Return how many records were dropped, ``""`` for none in the last ten seconds."""
    if not n_dropped or time.monotonic() - newest_s > DROPS_REPORTED_S:
        return ""
    return f"{n_dropped} records dropped"


class Backlog:
    """Records that wait for a possibly slow subscriber, and the thread that hands them over in order.

    The tables, the displays, the markers and the stages beside the connected ones each have one. With
    ``most`` records waiting, one is dropped and counted in ``n_dropped``: the oldest if ``newest``, for a
    display of the current state, else the new one. ``n_put`` counts all that came; ``waited_s`` is how long
    the one handed over last had waited. ``idle`` is called in the thread, some hundred times a second, while
    nothing waits. ``rank`` wraps the thread's work, such as :func:`tega.runtime.threads.run_realtime`.
    """

    def __init__(
        self,
        name: str,
        *,
        most: int = 65_536,
        newest: bool = False,
        idle: Callable[[], object] = lambda: None,
        rank: Callable[[Callable[[], None]], Callable[[], None]] = lambda work: work,
    ) -> None:
        self._name, self._most, self._newest, self._idle, self._rank = name, most, newest, idle, rank
        self._waiting: deque[tuple[Callable[[Any, Any], None], Any, Any, float]] = deque()
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None
        self.n_put = self.n_dropped = 0
        self._dropped_at_s = 0.0
        self.waited_s = 0.0

    def start(self) -> None:
        """Begin to hand over, unless that has begun."""
        if self._thread is None:
            self._closing.clear()
            self._thread = threading.Thread(
                target=self._rank(self._work), name=f"tega-{self._name}", daemon=True
            )
            self._thread.start()

    def put(self, deliver: Callable[[Any, Any], None], to: Any, record: object) -> None:
        """Let a record wait until ``deliver(to, record)`` is called with it in the thread; returns at once."""
        self.n_put += 1
        if self._closing.is_set():
            self._drop()
            return
        if len(self._waiting) >= self._most:
            self._drop()
            if not self._newest:
                return
            with contextlib.suppress(IndexError):  # the thread has just taken it
                self._waiting.popleft()
        self._waiting.append((deliver, to, record, time.monotonic()))

    @property
    def running(self) -> bool:
        """Whether records are handed over."""
        return self._thread is not None and self._thread.is_alive()

    def problem(self) -> str:
        """Return how many records were dropped while that goes on; ``""`` else, and where only the newest is wanted."""
        dropped = "" if self._newest else report_drops(self.n_dropped, self._dropped_at_s)
        return f"{self._name}: {dropped}, it does not keep up" if dropped else ""

    def close(self) -> None:
        """Wait for the remaining records, ten seconds at most, and end the thread."""
        self._closing.set()
        thread, self._thread = self._thread, None
        if thread is not None:
            thread.join(_DRAIN_S)

    def _drop(self) -> None:
        self.n_dropped += 1
        self._dropped_at_s = time.monotonic()

    def _work(self) -> None:
        while True:
            closing = self._closing.is_set()  # looked at first: nothing comes after it
            try:
                deliver, to, record, put_s = self._waiting.popleft()
            except IndexError:
                if closing:
                    return
                self._idle()
                self._closing.wait(_WAIT_S)
            else:
                self.waited_s = time.monotonic() - put_s
                deliver(to, record)
