"""Choose how a person is guided; show prompts on a page in the browser: large words, live bars, buttons to go on."""

from __future__ import annotations

import contextlib
import queue
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from html import escape
from typing import TYPE_CHECKING, Any, Final, Self

from tega.runtime.guide import Bar, Guide, Undecided
from tega.runtime.lifecycle import require
from tega.ui.cli.guide import LineGuide, TerminalGuide

if TYPE_CHECKING:
    from tega.ui.view.browser.local import LocalServer

_WIDTH = 900
_PAINT_S: Final = 1 / 20
_LAST_S = 0.1
_MOST_LINES = 6
_COLOURS: Final = {"plain": "#343a40", "good": "#2a8339", "warn": "#a85400", "bad": "#c92a2a"}
_TARGET, _FILLED = "#fd8d3c", "#1f5fbf"


class PageGuide(LineGuide):
    """Large prompts, live bars and buttons on a page; messages also go to stderr.

    Use as a context manager. With ``yes`` nothing waits for the button: each prompt is shown for
    ``get_ready_s``. Where ``port`` is taken, the next free one is used; 0 takes any. ``allow_remote`` lets
    ``host`` be an address that others can reach. ``prompt``, with the bars, and ``said``, the last message,
    are HTML; ``buttons`` are viser's handles of those that wait to be pressed, by answer.
    """

    def __init__(
        self,
        title: str,
        *,
        yes: bool,
        get_ready_s: float,
        host: str = "127.0.0.1",
        port: int = 0,
        allow_remote: bool = False,
    ) -> None:
        super().__init__(yes=yes, get_ready_s=get_ready_s)
        self._title, self._host, self._port, self._allow_remote = title, host, port, allow_remote
        self._server: LocalServer
        self._reported: list[str] = []
        self._painted_s = 0.0
        self.buttons: dict[str, Any] = {}

    def __enter__(self) -> Self:
        """Serve the page."""
        require("viser", driver="page", extra="view")
        from tega.ui.view.browser.local import LocalServer
        from tega.ui.view.browser.state_html import STYLE

        self._server = LocalServer(self._host, self._port, self._title, allow_remote=self._allow_remote)
        gui = self._server.gui
        gui.configure_theme(show_logo=False, show_share_button=False, brand_color=(31, 95, 191))
        gui.set_panel_label(self._title)
        gui.add_html(STYLE)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(_WIDTH)
        self.prompt, self.said = gui.add_html(""), gui.add_html("")
        return self

    def __exit__(self, *_error: object) -> None:
        """Stop serving; the last message stays in the browser."""
        self._paint("The end", [], "")
        self._server.flush()
        time.sleep(_LAST_S)  # what is flushed is sent by another thread
        self._server.stop()

    @property
    def url(self) -> str:
        """Address of the page, with the token that it needs."""
        return self._server.url

    def part(self, title: str, why: str) -> None:
        """Begin a part."""
        super().part(title, why)
        self._reported = []
        self._notify(f"<b>{escape(title)}</b>: {escape(why)}")

    def say(self, text: str, *, tone: str = "plain") -> None:
        """Show a message."""
        super().say(text, tone=tone)
        self._notify(f'<span style="color:{_COLOURS[tone]}">{escape(text)}</span>')

    def ready(self, prompt: str) -> None:
        """Wait for the button."""
        if self._yes:
            self._paint(prompt, [], "")
            super().ready(prompt)
        else:
            self._pressed(prompt, {"ready": "Ready"})

    def ask(self, question: str, answers: Mapping[str, str]) -> str:
        """Ask until one of the answers' buttons is pressed."""
        if self._yes:
            raise Undecided
        return self._pressed(question, {key: meaning or key for key, meaning in answers.items()})

    def show(self, prompt: str, bars: Sequence[Bar], left_s: float | None) -> None:
        """Redraw prompt and bars, as often as a page is worth."""
        now_s = time.monotonic()
        if now_s - self._painted_s >= _PAINT_S:
            self._painted_s = now_s
            self._paint(prompt, bars, "" if left_s is None else f"{left_s:.0f} s left")

    def _pressed(self, prompt: str, labels: Mapping[str, str]) -> str:
        self._paint(prompt, [], "")
        pressed: queue.SimpleQueue[str] = queue.SimpleQueue()

        def puts(key: str) -> Callable[[Any], None]:
            return lambda _event: pressed.put(key)

        for key, label in labels.items():
            button = self.buttons[key] = self._server.gui.add_button(label)
            button.on_click(puts(key))
        try:
            while True:
                with contextlib.suppress(queue.Empty):
                    return pressed.get(timeout=0.2)  # so that Ctrl-C is noticed
        finally:
            for button in self.buttons.values():
                button.remove()
            self.buttons = {}

    def _paint(self, prompt: str, bars: Sequence[Bar], below: str) -> None:
        style = "font-family:system-ui,sans-serif;color:#343a40;text-align:center;padding:18px"
        self.prompt.content = (
            f'<div style="{style}"><div style="font-size:34px;font-weight:bold;margin:10px">{escape(prompt)}</div>'
            f'{"".join(map(_bar_html, bars))}<div style="font-size:14px;color:#6c757d">{escape(below)}</div></div>'
        )

    def _notify(self, line: str) -> None:
        self._reported = [*self._reported, line][-_MOST_LINES:]
        style = "font-family:system-ui,sans-serif;font-size:14px;padding:4px 18px;line-height:1.6"
        self.said.content = f'<div style="{style}">{"<br>".join(self._reported)}</div>'


def _bar_html(bar: Bar) -> str:
    low, high = (100 * min(1.0, max(0.0, end)) for end in (bar.low, bar.share))
    colour = _TARGET if bar.low > 0 else _FILLED
    place = f"position:absolute;left:{low:.1f}%;width:{max(high - low, 0.0):.1f}%;height:100%"
    return (
        '<div style="display:flex;align-items:center;gap:12px;margin:8px 0;font-size:16px">'
        f'<span style="width:5em;text-align:right">{escape(bar.name)}</span>'
        '<div style="position:relative;flex:1;height:34px;background:#e9ecef">'
        f'<div style="{place};background:{colour}"></div></div>'
        f'<span style="width:9em;text-align:left">{escape(bar.text)}</span></div>'
    )


@contextmanager
def guided(title: str, *, yes: bool, get_ready_s: float, view_port: int | None = None) -> Iterator[Guide]:
    """Guide a person on a page, or on the terminal, and give either back at the end."""
    if view_port is not None:
        from tega.ui.cli.page import open_page, page_address

        with PageGuide(title, yes=yes, get_ready_s=get_ready_s, port=view_port, **page_address()) as page:
            open_page(page.url)
            yield page
        return
    drawn = sys.stderr.isatty() and (yes or sys.stdin.isatty())
    with contextlib.closing(
        (TerminalGuide if drawn else LineGuide)(yes=yes, get_ready_s=get_ready_s)
    ) as guide:
        yield guide
