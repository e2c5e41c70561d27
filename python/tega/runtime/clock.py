"""Provide the loop's time, which a test or a replay can replace, and call functions every so many seconds.

All times are integer nanoseconds on a monotonic scale. Nothing in TEGA's outputs is a time of day.

Example:
    >>> clock = ManualClock()
    >>> clock.sleep_until(3_000_000)
    >>> clock.now_ns()
    3000000
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol

_PAUSE_POLL_S = 0.02
_TOGETHER_S = 0.001


def since_boot_s() -> float:
    """Return the time since some moment, seconds, with all the time that the computer slept."""
    if sys.platform == "win32":
        return time.monotonic()  # which goes on in a sleep there
    if sys.platform == "linux":
        return time.clock_gettime(time.CLOCK_BOOTTIME)
    return time.clock_gettime(time.CLOCK_MONOTONIC)


def _boot_and_asleep_s() -> tuple[float, float]:
    """Return the time since boot, and how far it is ahead of the clock that stands still in a sleep."""
    while True:
        before_s, boot_s, after_s = time.monotonic(), since_boot_s(), time.monotonic()
        if after_s - before_s < _TOGETHER_S:  # else the program was stopped between the two clocks
            return boot_s, boot_s - before_s


class Standstill:
    """Detects that this program did not run, since it was stopped, got no processor, or the computer slept.

    Up to ``longest_s`` between two calls of :meth:`pulse` is no standstill; ``slept_s`` is how long the computer slept
    in the last one.
    """

    def __init__(self, longest_s: float) -> None:
        self._longest_s = longest_s
        self._last_s, self._asleep_s = _boot_and_asleep_s()
        self.slept_s = 0.0

    def pulse(self) -> bool:
        """Take note that the program runs; return whether it stood still since the last call."""
        now_s, asleep_s = _boot_and_asleep_s()
        stood_s, slept_s = now_s - self._last_s, asleep_s - self._asleep_s
        self._last_s, self._asleep_s = now_s, asleep_s
        self.slept_s = slept_s if slept_s > self._longest_s else 0.0
        return stood_s > self._longest_s

    def is_over(self) -> bool:
        """Return whether the last call of :meth:`pulse` was longer ago than that."""
        return since_boot_s() - self._last_s > self._longest_s


class Clock(Protocol):
    """A source of monotonic time that can also be waited on."""

    def now_ns(self) -> int:
        """Return the time in nanoseconds; never less than an earlier answer."""

    def sleep_until(self, t_ns: int) -> None:
        """Return when the clock has reached ``t_ns`` (at once if it already has)."""


class SystemClock:
    """The machine's monotonic clock."""

    def now_ns(self) -> int:
        """Return the machine's monotonic time in nanoseconds."""
        return time.monotonic_ns()

    def sleep_until(self, t_ns: int) -> None:
        """Sleep until the monotonic clock shows ``t_ns``."""
        while (left_ns := t_ns - time.monotonic_ns()) > 0:
            time.sleep(left_ns * 1e-9)


class ManualClock:
    """A clock that moves only when it is set; waiting on it moves it and never sleeps."""

    def __init__(self, t_ns: int = 0) -> None:
        self._t_ns = t_ns

    def now_ns(self) -> int:
        """Return the time it was last moved to, in nanoseconds."""
        return self._t_ns

    def sleep_until(self, t_ns: int) -> None:
        """Move to ``t_ns``, unless it is already later."""
        self._t_ns = max(self._t_ns, t_ns)


class PausableClock:
    """Another clock (``None``: the machine's) that stands still, as a wait does, while ``paused`` returns true."""

    def __init__(self, paused: Callable[[], bool], clock: Clock | None = None) -> None:
        self._paused = paused
        self._clock = SystemClock() if clock is None else clock
        self.held_ns = 0

    def now_ns(self) -> int:
        """Return the other clock's time less the pauses so far, in nanoseconds."""
        return self._clock.now_ns() - self.held_ns

    def sleep_until(self, t_ns: int) -> None:
        """Sleep through a pause, then until the clock shows ``t_ns``."""
        if self._paused():
            held_since_ns = self._clock.now_ns()
            while self._paused():
                time.sleep(_PAUSE_POLL_S)
            self.held_ns += self._clock.now_ns() - held_since_ns
        self._clock.sleep_until(t_ns + self.held_ns)


@contextmanager
def every(action: Callable[[], object], *, every_s: float) -> Iterator[None]:
    """Call a function at once, and again after each rest, in another thread; the block ends after the last call.

    An exception of the function, a panic of native code too, ends the calls and is reported as that of a dying thread.
    """
    over = threading.Event()

    def work() -> None:
        action()
        while not over.wait(every_s):
            action()

    thread = threading.Thread(target=work, name="tega-every", daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
