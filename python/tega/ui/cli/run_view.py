"""Show a run on the terminal: a progress bar while it is prepared, then the live view."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

from tega.records.bus import Backlog
from tega.records.display import DisplayRows
from tega.ui.cli.options import progress_bar

if TYPE_CHECKING:
    from tega.loop.prepare import Progress
    from tega.loop.snapshot import LoopView
    from tega.records.bus import Bus


class TerminalDisplay:
    """Draws the newest moment in a thread of its own: drawing takes longer than a tick of the hand."""

    def __init__(self, title: str) -> None:
        from tega.ui.view.terminal import TerminalView

        self._view = TerminalView(title)
        self._newest: tuple[LoopView, Mapping[str, str], float] | None = None
        self._waiting = Backlog("view", most=1, newest=True, idle=self._draw)

    def opened(self, url: str) -> None:
        """Print the page's address, and keep it in sight in the frame."""
        from tega.ui.cli.page import open_page

        open_page(url)
        self._view.address = url

    def watch(self, bus: Bus) -> None:
        """Show the moments of a run from now on."""
        from tega.loop.snapshot import Snapshot  # not before a run opens its devices

        rows = DisplayRows(bus, "terminal")
        bus.subscribe(
            Snapshot,
            lambda snapshot: self._take((snapshot.view, rows())),
            name="display",
            backlog=self._waiting,
        )

    def __call__(self, view: LoopView, rows: Mapping[str, str] = {}) -> None:
        """Show a view of the loop and further lines of text, by name; returns at once."""
        self._waiting.put(TerminalDisplay._take, self, (view, rows))

    def open(self) -> None:
        """Take the screen."""
        self._view.__enter__()
        self._waiting.start()

    def close(self) -> None:
        """Give the screen back."""
        self._waiting.close()
        self._view.__exit__(None, None, None)

    def _take(self, given: tuple[LoopView, Mapping[str, str]]) -> None:
        self._newest = (*given, time.monotonic() - self._waiting.waited_s)
        self._draw()

    def _draw(self) -> None:
        """Draw the newest moment and its age, as often as a screen is worth."""
        if self._newest is not None:
            view, rows, came_s = self._newest
            self._view(view, rows, age_s=time.monotonic() - came_s)


@contextmanager
def stage(title: str, *, enabled: bool) -> Iterator[tuple[Progress, TerminalDisplay | None]]:
    """Show preparation and run on a terminal's stderr.

    Yield the ``progress`` argument for ``run_session``, and the display of the run; ``None`` without one.
    """
    if not enabled or not sys.stderr.isatty():
        yield lambda _subject, _done, _total: None, None
        return
    display = TerminalDisplay(title)
    with ExitStack() as ending, ExitStack() as stack:
        bar = stack.enter_context(progress_bar())

        def progress(subject: str, done: int, total: int) -> None:
            if subject == "running":
                stack.close()
                display.open()
                ending.callback(display.close)
            else:
                bar(subject, done, total)

        yield progress, display
