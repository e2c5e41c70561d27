"""Show the experimenter a session and read the keys: in a terminal, also over SSH, or as plain lines.

The keys of a running trial are here as well, and what the keys that foot switches type mean.
"""

from __future__ import annotations

import queue
import sys
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, Final, NamedTuple, Protocol, Self

import click

from tega.errors import InvalidValueError
from tega.runtime.keys import Keys
from tega_study.lead.rest_tasks import RestTask

if TYPE_CHECKING:
    from rich.console import RenderableType


ENTER = "\n"
_LINE_EVERY_S = 5.0
_POLL_S = 0.05


class Screen(NamedTuple):
    """Contents of the experimenter's screen; ``big`` is the large line: a clock, or what to do."""

    phase: str
    heading: str
    big: str
    lines: Sequence[str] = ()
    keys: Sequence[tuple[str, str]] = ()
    wrong: Sequence[str] = ()


class Desk(Protocol):
    """Shows and listens. Nothing waits but :meth:`line`."""

    def show(self, screen: Screen) -> None:
        """Show the state."""
        ...

    def say(self, text: str) -> None:
        """Show a message that stays on the screen."""
        ...

    def keys(self) -> list[str]:
        """Return the keys pressed since the last call; Enter is :data:`ENTER`."""
        ...

    def line(self, prompt: str) -> str:
        """Wait for a typed line."""
        ...


def desk_for(stop: Callable[[], bool], *, alone: bool = False) -> LineDesk | _TerminalDesk:
    """Return the desk that fits where this runs."""
    return _TerminalDesk(stop) if sys.stdin.isatty() and sys.stderr.isatty() else LineDesk(stop, alone=alone)


class LineDesk:
    """One line at a time on stderr; keys are letters in lines of stdin, an empty line is Enter.

    :meth:`keys` and :meth:`line` raise ``KeyboardInterrupt`` at stdin's end: the experimenter has gone.
    """

    def __init__(self, stop: Callable[[], bool] = lambda: False, *, alone: bool = False) -> None:
        self._stop, self._alone = stop, alone
        self._received: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._displayed: tuple[object, ...] = ()
        self._displayed_s = 0.0
        self._gone = False

    def __enter__(self) -> Self:
        """Begin to listen."""
        threading.Thread(target=self._listen, name="tega-desk", daemon=True).start()
        return self

    def __exit__(self, *_error: object) -> None:
        """Nothing to give back: the thread ends with stdin or the program."""

    def _listen(self) -> None:
        for line in sys.stdin:
            self._received.put(line.rstrip("\n"))
        self._received.put(None)

    def show(self, screen: Screen) -> None:
        """Show the state when it changes, and every five seconds."""
        now_s = time.monotonic()
        subject = screen.phase, screen.heading, tuple(screen.lines), tuple(screen.wrong)
        if subject == self._displayed and now_s - self._displayed_s < _LINE_EVERY_S:
            return
        self._displayed, self._displayed_s = subject, now_s
        parts = [f"[{screen.phase}] {screen.heading} | {screen.big}", *screen.lines]
        click.echo(" | ".join(parts + [f"! {one}" for one in screen.wrong]), err=True)

    def say(self, text: str) -> None:
        """Show a message."""
        click.echo(f"  {text}", err=True)

    def keys(self) -> list[str]:
        """Return the keys of the lines that have come."""
        found: list[str] = []
        if self._gone and not self._alone:
            raise KeyboardInterrupt
        while not self._received.empty():
            line = self._received.get()
            if line is None:
                self._gone = True
                break
            found += list(line) or [ENTER]
        if self._gone and not found and not self._alone:
            click.echo("No terminal input. To rehearse without an experimenter, use --yes.", err=True)
            raise KeyboardInterrupt
        return found

    def line(self, prompt: str) -> str:
        """Wait for a line."""
        click.echo(f"? {prompt}", err=True)
        while not self._stop():
            try:
                line = self._received.get(timeout=_POLL_S)
            except queue.Empty:
                continue
            if line is None:
                break
            return line
        raise KeyboardInterrupt


class _TerminalDesk:
    """A picture that is redrawn in place on stderr, and single keys."""

    def __init__(self, stop: Callable[[], bool] = lambda: False) -> None:
        from rich.console import Console
        from rich.live import Live

        self._stop, self._keys, self._open = stop, Keys(), ExitStack()
        self._console = Console(stderr=True, highlight=False)
        self._live = Live(console=self._console, transient=True, auto_refresh=False)

    def __enter__(self) -> Self:
        with ExitStack() as opened:
            opened.enter_context(self._keys)
            opened.enter_context(self._live)
            self._open = opened.pop_all()
        return self

    def __exit__(self, *_error: object) -> None:
        self._open.close()

    def show(self, screen: Screen) -> None:
        self._live.update(_panel(screen), refresh=True)

    def say(self, text: str) -> None:
        self._console.print(text, markup=False)

    def keys(self) -> list[str]:
        return [ENTER if key in {"\r", "\n"} else key for key in self._keys.read()]

    def line(self, prompt: str) -> str:
        """Ask in the picture's place; Backspace takes back, and other keys' sequences are passed over."""
        typed = ""
        while not self._stop():
            for key in self.keys():
                if key == ENTER:
                    self._console.print(f"{prompt} {typed}", markup=False)
                    return typed
                if key in {"\x7f", "\x08"}:
                    typed = typed[:-1]
                elif len(key) == 1 and key.isprintable():
                    typed += key
            self.show(
                Screen("question", prompt, f"{typed}_", (), [("Enter", "answer"), ("Backspace", "take back")])
            )
            time.sleep(_POLL_S)
        raise KeyboardInterrupt


def _panel(screen: Screen) -> RenderableType:
    from rich.align import Align
    from rich.console import Group
    from rich.panel import Panel
    from rich.table import Table
    from rich.text import Text

    wrong = [Text(f"! {one}", style="bold red") for one in screen.wrong]
    keys = Table.grid(padding=(0, 2))
    for n in range(0, len(screen.keys), 3):
        cells = [f"[bold cyan]{key}[/] {subject}" for key, subject in screen.keys[n : n + 3]]
        keys.add_row(*cells)
    rows: list[RenderableType] = [
        Text(screen.heading, style="bold", justify="center"),
        Text(),
        Align.center(Text(f" {screen.big} ", style="bold reverse")),
        Text(),
        *(Text(line, justify="center") for line in screen.lines),
        *wrong,
        Text(),
        Align.center(keys),
    ]
    colour = {"trial": "green", "rest": "blue", "countdown": "yellow"}.get(screen.phase, "cyan")
    return Panel(Group(*rows), title=screen.phase.upper(), border_style=colour, padding=(0, 2))


END = "e"

_PRESSED: Final = ((ENTER, " "), (END,), ("s",), ("d",), ("r",))
"""What each pedal presses: go on and mark the height, end the trial, slip, deformation, do it again."""
_BETWEEN: Final = frozenset("yfurnqk ")


def keys_of(*, sees_height: bool, measures_height: bool = False) -> list[tuple[str, str]]:
    """Return the keys of a running trial and their descriptions."""
    words = ("correct: " if measures_height else "") + "left the table, then at the mark"
    mark = [] if sees_height else [("space", words)]
    return [
        *mark,
        ("s", "slip"),
        ("d", "deformation"),
        ("x", "dropped"),
        ("u", "undo"),
        (END, "done"),
        ("a", "break off, technical"),
        ("z", "stop for safety"),
    ]


def pedal_keys(pedals: str, tasks: Iterable[RestTask]) -> dict[str, tuple[str, ...]]:
    """Return which keys of the session each pedal presses.

    ``pedals`` are up to five different keys that mean nothing else, also in ``tasks``, which the bench offers in
    a rest: to go on and mark the height, to end the trial, for a slip, a deformation, to do the trial again.
    """
    for task in tasks:
        if task.key in pedals:
            raise InvalidValueError(
                f"pedal {task.key!r}: begins {task.words} in a rest", "take digits, such as 12345"
            )
    taken = _BETWEEN | {key for key, _ in keys_of(sees_height=False)}
    odd = len(set(pedals)) != len(pedals) or len(pedals) > len(_PRESSED) or not pedals.isprintable()
    if odd or set(pedals) & taken:
        raise InvalidValueError(
            f"pedals {pedals!r}: they are not one to five keys that mean nothing else in a session",
            "name what pedals type to go on, to end, for a slip, a deformation and to do it again, such as 12345",
        )
    return dict(zip(pedals, _PRESSED, strict=False))


def check_answer_key(key: str, pedals: str) -> None:
    """Raise ``InvalidValueError`` unless the key is one printable key without another meaning in a session.

    A press that comes late, in the rest, would correct the trial. ``pedals``: whatever else types a key.
    """
    taken = _BETWEEN | {one for one, _ in keys_of(sees_height=False)} | {*pedals}
    if len(key) != 1 or not key.isprintable() or key in taken:
        raise InvalidValueError(
            f"answer key {key!r}: it is not one key, or means something else in a session",
            "take p, for example",
        )
