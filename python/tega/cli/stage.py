"""Show a run on the terminal: a bar for the preparation, then the live view."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Protocol

from tega.cli.options import progress_bar

if TYPE_CHECKING:
    from tega.teleop.moment import LoopView
    from tega.teleop.prepare import Progress

__all__ = ["Watcher", "stage"]

_REDRAW_S = 0.1


class Watcher(Protocol):
    """Takes a moment to be shown, and what else there is to tell of it, by name."""

    def __call__(self, view: LoopView, rows: Mapping[str, str] = {}) -> None:
        """Take it; returns at once."""
        ...


@contextmanager
def stage(title: str, *, enabled: bool) -> Iterator[tuple[Progress, Watcher | None]]:
    """Show preparation and run on a terminal's stderr.

    The picture is drawn by a thread of its own, from the newest moment it was given: drawing takes longer than a
    tick of the hand.

    Args:
        title: Heading of the live view.
        enabled: Whether to show anything at all.

    Yields:
        What to give ``run_session`` as ``progress`` and as ``observer``.
    """
    if not enabled or not sys.stderr.isatty():
        yield lambda _what, _done, _total: None, None
        return
    newest: list[tuple[LoopView, Mapping[str, str], float]] = []
    over = threading.Event()

    def draw() -> None:
        from tega.view.terminal import TerminalView

        with TerminalView(title) as view:
            while not over.wait(_REDRAW_S):
                if newest:
                    moment, rows, came_s = newest[-1]
                    view(moment, rows, age_s=time.monotonic() - came_s)

    drawing = threading.Thread(target=draw, name="tega-view", daemon=True)
    with ExitStack() as stack:
        bar = stack.enter_context(progress_bar())

        def progress(what: str, done: int, total: int) -> None:
            if what == "running":
                stack.close()
                drawing.start()
            else:
                bar(what, done, total)

        def observe(view: LoopView, rows: Mapping[str, str] = {}) -> None:
            newest[:] = [(view, rows, time.monotonic())]

        try:
            yield progress, observe
        finally:
            over.set()
            if drawing.is_alive():
                drawing.join()
