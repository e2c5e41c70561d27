"""Choose how a calibration guides a person: on a page, large on a terminal, or one line at a time."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from tega.runtime.guide import Guide
from tega.ui.cli.guide import LineGuide, TerminalGuide


def guide_for(*, yes: bool, get_ready_s: float) -> Guide:
    """Return the guide that fits where this runs."""
    if sys.stderr.isatty() and (yes or sys.stdin.isatty()):
        return TerminalGuide(yes=yes, get_ready_s=get_ready_s)
    return LineGuide(yes=yes, get_ready_s=get_ready_s)


@contextmanager
def guided(title: str, *, yes: bool, get_ready_s: float, view_port: int | None = None) -> Iterator[Guide]:
    """Guide a person on a page, or on the terminal, and give either back at the end."""
    if view_port is not None:
        from tega.ui.cli.guide_page import PageGuide
        from tega.ui.cli.page import open_page, page_address

        with PageGuide(title, yes=yes, get_ready_s=get_ready_s, port=view_port, **page_address()) as page:
            open_page(page.url)
            yield page
        return
    guide = guide_for(yes=yes, get_ready_s=get_ready_s)
    try:
        yield guide
    finally:
        if isinstance(guide, TerminalGuide):
            guide.close()
