"""Collect the wishes to stop a run, from wherever they come, and keep why."""

from __future__ import annotations

from collections.abc import Callable


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
        """Poll another source too, such as a page's button or a pedal.

        ``source`` returns at once: the reason once it wants the run to end, ``""`` before.
        """
        self._sources.append(source)
