"""Open a device again that went away: soon at first, then less and less often, for as long as it is wanted.

Every driver and every reader that looks for a lost device takes its intervals from here. Devices that must not be
reopened automatically do not: a hand that has found a fault, an arm that has stopped. For those a person decides.
"""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from typing import TypeVar

Over = Callable[[float], object]
"""Waits so many seconds, or until the device is no longer wanted; returns whether it is no longer wanted."""

_Link = TypeVar("_Link")


class Reopening:
    """Paces the tries to open one device again.

    The first rest after the device has worked is ``first_s``, each next one longer by ``factor``, up to
    ``most_s``. Rests vary by up to the share ``spread``, so that several programs do not try in step.
    """

    def __init__(self, first_s: float, most_s: float, *, factor: float = 2.0, spread: float = 0.0) -> None:
        self._first_s, self._most_s, self._factor, self._spread = first_s, most_s, factor, spread
        self._rest_s = first_s
        self._due_s = 0.0

    def works(self) -> None:
        """Note that the device gave something: it is looked for soon when it goes away next."""
        self._rest_s, self._due_s = self._first_s, 0.0

    def _next_rest_s(self) -> float:
        rest_s, self._rest_s = self._rest_s, min(self._factor * self._rest_s, self._most_s)
        return rest_s

    def wait(self, over: Over) -> bool:
        """Rest before the next try; return whether to try."""
        return not over(self._next_rest_s() * random.uniform(1 - self._spread, 1 + self._spread))

    def due(self) -> bool:
        """Return whether to try now, for a thread that must not sleep; if so, restart the interval."""
        now_s = time.monotonic()
        if is_due := now_s >= self._due_s:
            self._due_s = now_s + self._next_rest_s()
        return is_due

    def open(
        self,
        open_device: Callable[[], _Link],
        over: Over,
        *,
        absent: type[Exception] | tuple[type[Exception], ...],
        refused: Callable[[Exception], object] = lambda _error: None,
    ) -> _Link | None:
        """Try until the device opens; ``None`` when it is no longer wanted.

        ``refused`` is called with errors of ``absent``, which mean that it is not there yet; others are raised.
        """
        while self.wait(over):
            try:
                return open_device()
            except absent as error:
                refused(error)
        return None

    def serve(
        self,
        link: _Link | None,
        open_device: Callable[[], _Link],
        use: Callable[[_Link], bool],
        close: Callable[[_Link], object],
        over: Over,
        *,
        refused: Callable[[Exception], object] = lambda _error: None,
    ) -> None:
        """Use a device until it is no longer wanted, and whenever it goes away, open it as :meth:`open` does.

        ``use`` lasts until the device goes away or is no longer wanted, and returns whether it gave anything. A
        device whose library raises an error has gone away, too, of whatever kind it is: the thread goes on.
        """
        while not over(0.0):
            if (
                link is None
                and (link := self.open(open_device, over, absent=Exception, refused=refused)) is None
            ):
                return
            try:
                if use(link):
                    self.works()
            except Exception as error:  # libraries raise what they like
                refused(error)
            finally:
                close(link)
            link = None
        if link is not None:
            close(link)


def polled(stopped: Callable[[], bool], *, every_s: float) -> Over:
    """Return an :data:`Over` from a function that returns whether the device is no longer wanted."""

    def over(rest_s: float) -> bool:
        until_s = time.monotonic() + rest_s
        while not stopped():
            left_s = until_s - time.monotonic()
            if left_s <= 0:
                return False
            time.sleep(min(left_s, every_s))
        return True

    return over
