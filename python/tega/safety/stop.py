"""Collect the wishes to stop a run, from wherever they come, and keep why; turn Ctrl-C into one."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any


class Stop:
    """Stop request of a run, which polls it; ``ask`` makes the request, with a reason.

    Attributes:
        requested: Whether a stop was requested.
        reason: Source of the first request, such as ``Ctrl-C``.

    Example:
        >>> stop = Stop()
        >>> stop(), stop.ask("the space bar"), stop(), stop.reason
        (False, None, True, 'the space bar')
    """

    def __init__(self) -> None:
        self.requested = False
        self.reason = ""
        self._sources: list[Callable[[], str]] = []

    def __call__(self) -> bool:
        """Return whether the run should end."""
        if not self.requested:
            for source in self._sources:
                if text := source():
                    self.ask(text)
                    break
        return self.requested

    def ask(self, reason: str) -> None:
        """Ask for the end; the first reason counts."""
        if not self.requested:
            self.requested, self.reason = True, reason

    def also(self, source: Callable[[], str]) -> None:
        """Poll another source too, which returns at once: the reason once it wants the run to end, ``""`` before."""
        self._sources.append(source)


_PATIENCE_S = 1.0


class CtrlC(Stop):
    """Turns the first Ctrl-C (or request to terminate) into a stop that the loop polls, which leaves all silent.

    After a stop, from wherever it came, further ones do nothing; the first after a second interrupts whatever hangs.
    """

    def __init__(self) -> None:
        super().__init__()
        self._at_once = False
        self._old: dict[int, Any] = {}
        self._requested_s = 0.0
        self._interrupted = False

    def ask(self, reason: str) -> None:
        """Ask for the end; the first reason counts."""
        if not self.requested:
            self._requested_s = time.monotonic()
        super().ask(reason)

    def _on_signal(self, number: int, _frame: FrameType | None) -> None:
        if not self.requested:
            self.ask("Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name)
            if self._at_once:
                self._interrupted = True
                raise KeyboardInterrupt
        elif not self._interrupted and time.monotonic() - self._requested_s > _PATIENCE_S:
            self._interrupted = True
            raise KeyboardInterrupt

    @contextmanager
    def interrupting(self) -> Iterator[None]:
        """Have the first one interrupt, as long as nothing runs that would have to be left silent."""
        self._at_once = True
        try:
            yield
        finally:
            self._at_once = False

    def __enter__(self) -> CtrlC:
        """Take over the signals."""
        # The last one comes when the terminal is closed or the connection to it is lost; Windows has none.
        for number in (signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)):
            # Who starts it with nohup wants it to go on.
            if number in self._old or signal.getsignal(number) == signal.SIG_IGN:
                continue
            self._old[number] = signal.signal(number, self._on_signal)
        return self

    def __exit__(self, *_error: object) -> None:
        """Give the signals back."""
        for number, handler in self._old.items():
            signal.signal(number, handler)
