"""Show the prompts of a calibration: large with live bars on a terminal, one line at a time anywhere else."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Container, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from tega.runtime.guide import Bar, Undecided

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.live import Live


_MARKS = {"plain": "  ", "good": "ok", "warn": "! ", "bad": "x "}
_STYLES = {"plain": "", "good": "green", "warn": "yellow", "bad": "bold red"}
_LINE_EVERY_S = 1.0
_line = partial(click.echo, err=True)


class LineGuide:
    """One line at a time on stderr, answers from stdin.

    A line that begins with ``>`` waits for Enter, one with ``?`` for an answer. With ``yes`` nothing waits
    for Enter: each prompt is shown for ``get_ready_s``.
    """

    def __init__(self, *, yes: bool, get_ready_s: float) -> None:
        self._yes = yes
        self._get_ready_s = get_ready_s
        self._displayed_s = 0.0

    def part(self, title: str, why: str) -> None:
        """Begin a part."""
        _line(f"\n== {title} ==\n   {why}")

    def say(self, text: str, *, tone: str = "plain") -> None:
        """Show a message."""
        _line(f"{_MARKS[tone]} {text}")

    def ready(self, prompt: str) -> None:
        """Wait for Enter."""
        _line(f"> {prompt}" + ("" if self._yes else " [Enter]"))
        if self._yes:
            time.sleep(self._get_ready_s)
        else:
            _received()

    def ask(self, question: str, answers: Mapping[str, str]) -> str:
        """Ask until one of the answers comes."""
        if self._yes:
            raise Undecided
        choices = ", ".join(f"{key} {meaning}".rstrip() for key, meaning in answers.items())
        _line(f"? {question} ({choices})")
        while (message := _received().strip().lower()) not in answers:
            _line(f"? one of: {choices}")
        return message

    def show(self, prompt: str, bars: Sequence[Bar], left_s: float | None) -> None:
        """Show the state once a second."""
        now_s = time.monotonic()
        if now_s - self._displayed_s < _LINE_EVERY_S:
            return
        self._displayed_s = now_s
        left = "" if left_s is None else f" {left_s:3.0f} s "
        _line(f"   {prompt}{left} " + "  ".join(f"{b.name} {_bar(b, 8)} {b.text}" for b in bars))

    def close(self) -> None:
        """Do nothing: no terminal was taken."""


class TerminalGuide(LineGuide):
    """Large prompts and live bars on a terminal's stderr."""

    def __init__(self, *, yes: bool, get_ready_s: float) -> None:
        from rich.console import Console

        super().__init__(yes=yes, get_ready_s=get_ready_s)
        self._console: Console = Console(stderr=True, highlight=False)
        self._live: Live | None = None
        self._displayed: tuple[str, Sequence[Bar]] = ("", ())

    def part(self, title: str, why: str) -> None:
        """Begin a part."""
        self.close()
        self._console.print()
        self._console.rule(f"[bold cyan]{title}", align="left")
        self._console.print(why, style="dim")

    def say(self, text: str, *, tone: str = "plain") -> None:
        """Show a message."""
        self.close()
        self._console.print(f"{_MARKS[tone]} {text}", style=_STYLES[tone], markup=False)

    def ready(self, prompt: str) -> None:
        """Wait for Enter."""
        if self._yes:
            end_s = time.monotonic() + self._get_ready_s
            while (left_s := end_s - time.monotonic()) > 0:
                self.show(prompt, [], left_s)
                time.sleep(0.05)
            self.close()
            return
        self.close()
        self._console.print(self._panel(prompt, "press Enter when ready"))
        _received()

    def ask(self, question: str, answers: Mapping[str, str]) -> str:
        """Ask until one of the answers comes; a single letter needs no Enter."""
        if self._yes:
            raise Undecided
        choices = "   ".join(f"{key} {meaning}".rstrip() for key, meaning in answers.items())
        if any(len(key) > 1 for key in answers):
            self.close()
            self._console.print(f"[bold cyan]{question}[/]   {choices}")
            while (answer := _received().strip().lower()) not in answers:
                self._console.print(f"one of: {', '.join(answers)}", style="yellow")
            return answer
        prompt, bars = self._displayed if self._live is not None else ("", ())

        def draw() -> None:
            self._update(self._panel(f"{prompt}\n\n{question}".strip(), choices, bars), at_once=True)

        answer = _key(draw, answers)
        # A question that still stands while the next vibration comes would be answered again, for nothing.
        self._update(self._panel(prompt or f"{question} {answers[answer]}", "", bars), at_once=True)
        return answer

    def show(self, prompt: str, bars: Sequence[Bar], left_s: float | None) -> None:
        """Redraw prompt and bars."""
        self._displayed = (prompt, bars)
        self._update(self._panel(prompt, "" if left_s is None else f"{left_s:.0f} s left", bars))

    def _update(self, panel: RenderableType, *, at_once: bool = False) -> None:
        from rich.live import Live

        if self._live is None:
            self._live = Live(console=self._console, transient=True, refresh_per_second=10)
            self._live.start()
        self._live.update(panel, refresh=at_once)

    def _panel(self, prompt: str, below: str, bars: Sequence[Bar] = ()) -> RenderableType:
        from rich.align import Align
        from rich.console import Group
        from rich.panel import Panel
        from rich.table import Table
        from rich.text import Text

        rows: list[Any] = [Text(), Align.center(Text(prompt, style="bold", justify="center")), Text()]
        if bars:
            table = Table.grid(padding=(0, 2))
            for bar in bars:
                colour = "green" if bar.share < 0.95 else "bright_green"
                table.add_row(bar.name, Text(_bar(bar, 40), style=colour), bar.text)
            rows += [Align.center(table), Text()]
        return Panel(Group(*rows), subtitle=below or None, border_style="cyan", padding=(0, 2))

    def close(self) -> None:
        """Give the terminal back."""
        live, self._live = self._live, None
        if live is not None:
            live.stop()


def _bar(bar: Bar, width: int) -> str:
    empty, filled = (round(min(1.0, max(0.0, end)) * width) for end in (bar.low, bar.share))
    # However narrow a target is, there is something to hit.
    empty = min(empty, filled - 1) if bar.low > 0 and filled else empty
    return "·" * empty + "█" * (filled - empty) + "·" * (width - filled)


def _received() -> str:
    line = sys.stdin.readline()
    if not line:
        raise KeyboardInterrupt  # the user who answered has gone
    return line


def _key(ask: Callable[[], None], answers: Container[str]) -> str:
    """Ask, and return the first key that is an answer; keys pressed before the question do not count."""
    from tega.runtime.keys import Keys

    with Keys() as keys:
        ask()
        while True:
            for key in keys.read():
                if key.lower() in answers:
                    return key.lower()
            time.sleep(0.02)
