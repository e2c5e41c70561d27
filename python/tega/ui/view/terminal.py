"""Show a run live in the terminal: fingers, vest, muscles, hand and rates on one screen."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Self

from rich.columns import Columns
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from tega.haptics import CONTACT_RULES, FINGERS
from tega.loop.touch import STALE_NS
from tega.ui.view.labels import ContactLabels
from tega.ui.view.run_state import MEANINGS, NO_NEWS, NO_NEWS_S, lines_beside
from tega.wire import HAND_FINGERS

if TYPE_CHECKING:
    from tega.haptics import MotorLevels
    from tega.loop.moment import LoopView

__all__ = ["TerminalView", "render"]

_BAR_WIDTH = 18
_REFRESH_S = 0.1
_STATE_STYLES = {
    "idle": "black on yellow",
    "armed": "black on cyan",
    "active": "black on green",
    "hold": "black on dark_orange",
    "stopped": "white on red",
}
_POSES = ("open", "pre-shape", "half", "wrap", "tight")
_CONTACT_COLOURS = {"none": "grey50", "focal": "bold yellow", "broad": "bold cyan", "mixed": "white"}
_SHADES = " ·░▒▓█"


def _bar(share: float, colour: str, width: int = _BAR_WIDTH) -> Text:
    filled = round(min(max(share, 0.0), 1.0) * width)
    return Text("█" * filled, style=colour) + Text("─" * (width - filled), style="grey37")


def _touch(view: LoopView, labels: ContactLabels) -> Table:
    table = Table(box=None, padding=(0, 1), expand=False)
    for name in ("", "CCI (front)", "EDA (back)", "contact"):
        table.add_column(name, no_wrap=True)
    for finger in FINGERS:
        contact = view.contacts.get(finger)
        if contact is None:
            table.add_row(finger, Text("no sensor", style="grey50"))
            continue
        if view.t_ns - contact.t_ns > STALE_NS:
            # Never the last value: nobody knows what is so now.
            table.add_row(finger, Text("no data", style="bold yellow"))
            continue
        kind = labels.name(contact)
        table.add_row(
            finger,
            _bar(contact.cci_norm, "blue") + Text(f" {contact.front:3.0f}"),
            _bar(contact.eda_norm, "green") + Text(f" {contact.back:3.0f}"),
            Text(f"{kind:<6}", style=_CONTACT_COLOURS[kind]),
        )
    return table


def _face(intensities: Sequence[int]) -> Text:
    """Draw one face of the vest: a block a motor, four a row, as the wearer's left to right."""
    text = Text()
    for start in range(0, len(intensities), 4):
        for value in intensities[start : start + 4]:
            shade = _SHADES[min(len(_SHADES) - 1, -(-value * (len(_SHADES) - 1) // 100))]
            text.append(shade * 3 + " ", style="red" if value >= 60 else "magenta")
        text.append("\n")
    return text


def _vest(frame: MotorLevels | None) -> RenderableType:
    if frame is None:
        return Text("no vest frame", style="grey50")
    values = [int(v) for v in frame.intensities]
    half = len(values) // 2
    faces = (
        Panel(_face(values[:half]), title="front", width=20),
        Panel(_face(values[half:]), title="back", width=20),
    )
    return Columns(faces, padding=(0, 1))


def _intent(view: LoopView) -> Table:
    table = Table(box=None, padding=(0, 1), expand=False)
    for _ in range(3):
        table.add_column(no_wrap=True)
    if view.intent is None:
        table.add_row("muscles", Text("no EMG yet", style="grey50"), "")
        return table
    channels, level_asked = view.intent.channels, view.intent.level
    for number, level in enumerate(channels, start=1):
        table.add_row(f"muscle {number}", _bar(level / 5, "yellow", 10), f"level {level}")
    table.add_row("hand", _bar(level_asked / 5, "red", 10), f"level {level_asked}: {_POSES[level_asked - 1]}")
    return table


def _closure(angles_rad: Sequence[float] | None) -> Text:
    if angles_rad is None:
        return Text("")
    bends = [sum(angles_rad[4 * finger + 1 : 4 * finger + 4]) for finger in range(4)]
    return Text(
        "  ".join(f"{n} {b:4.2f}" for n, b in zip(HAND_FINGERS, bends, strict=True)) + " rad bend", "grey70"
    )


def _inputs(view: LoopView) -> Table:
    """Draw what the operator's input devices say: axes that are pushed, and whether the switch is held."""
    table = Table(box=None, padding=(0, 1), expand=False)
    for name, seen in view.inputs.items():
        style = "bold red" if not seen.state.live else "bold green" if seen.held else "grey70"
        table.add_row(name.replace("_", " "), Text(seen.words(name), style=style))
    return table


def _arm(view: LoopView) -> Text:
    """Draw what the arm does and why, what the operator holds, and where the hand is."""
    text = Text.assemble((f"arm   {view.arm}", "bold"))
    if (arm := view.seen_arm) is not None:
        text.append(f"\n      {arm.switches}; hand at {arm.place}", "grey70")
    return text


def _task(rows: Mapping[str, str]) -> Text:
    """Draw what is going on, such as object, phase and height of a simulated trial."""
    text = Text()
    for name, value in rows.items():
        text.append(f"{name} ", style="grey50").append(f"{value}   ", style="bold")
    return text


def _state(view: LoopView, *, late: bool) -> Text:
    """Draw the run's state, why it is so where that is no good news, and what is wrong."""
    style = "white on grey50" if late else _STATE_STYLES[view.state]
    text = Text.assemble((f" {view.state.upper()} ", f"bold {style}"), f" {MEANINGS[view.state]}")
    reason, alerts = lines_beside(view)
    if reason:
        text.append(f"\n{reason}", "bold yellow")
    for alert in alerts:
        text.append(f"\n! {alert}", "yellow")
    return text


def render(
    view: LoopView,
    *,
    title: str,
    rates_hz: Mapping[str, float],
    rows: Mapping[str, str] = {},
    age_s: float = 0.0,
    labels: ContactLabels | None = None,
) -> RenderableType:
    """Draw one moment of the loop.

    Args:
        view: What the loop shows.
        title: Heading of the frame.
        rates_hz: Measured rates to show, by name.
        rows: What else to tell, by name; one line in all.
        age_s: How old the moment is; an old one is told to be, unless it is the last.
        labels: Names the contacts, and remembers what it called them.
    """
    late = age_s >= NO_NEWS_S and view.state != "stopped"
    rates = "   ".join(f"{name} {rate:.0f} Hz" for name, rate in rates_hz.items())
    body = Group(
        *(
            [Text(f"{NO_NEWS} {age_s:.0f} s: what stands here may no longer be so", "bold red")]
            if late
            else []
        ),
        *([_state(view, late=late)] if view.state else []),
        *([_task(rows)] if rows else []),
        _touch(view, labels or ContactLabels()),
        Text(f"focal: {CONTACT_RULES['focal']}\nbroad: {CONTACT_RULES['broad']}", style="grey50"),
        _vest(view.vest),
        _intent(view),
        _closure(view.angles_rad),
        *([Text(f"touch  {view.newest_event}", "bold")] if view.newest_event else []),
        *([Text(f"reflex {view.reflex}")] if view.reflex else []),
        *([_inputs(view)] if view.inputs else []),
        *([_arm(view)] if view.arm else []),
        *([Text(f"link  {view.link}")] if view.link else []),
        Text(f"{view.t_ns / 1e9:6.1f} s   {rates}", style="grey70"),
        *([Text(view.latency, style="grey70")] if view.latency else []),
    )
    return Panel(body, title=title, title_align="left", width=78)


class TerminalView:
    """Shows the loop while it runs; gives up frames rather than keep the loop waiting.

    Use as a context manager and pass it to the loop as its observer.

    Args:
        title: Heading of the frame.
        console: Where to draw; standard error when ``None``.
        now_s: The clock that the refresh and the shown rates go by.
    """

    def __init__(
        self,
        title: str,
        *,
        console: Console | None = None,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._title = title
        self._now_s = now_s
        self._live = Live(console=console or Console(stderr=True), auto_refresh=False, transient=True)
        self._drawn_s = -_REFRESH_S
        self._counted: tuple[float, dict[str, int]] | None = None
        self._rates_hz: dict[str, float] = {}
        self._labels = ContactLabels()

    def __enter__(self) -> Self:
        """Take the screen."""
        self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Give the screen back."""
        self._live.stop()

    def __call__(self, view: LoopView, rows: Mapping[str, str] = {}, *, age_s: float = 0.0) -> None:
        """Draw a moment, what else is told of it and its age, unless one was drawn just now.

        What fails in drawing is told on the screen in its place, and drawing goes on with the next moment.
        """
        now_s = self._now_s()
        if now_s - self._drawn_s < _REFRESH_S:
            return
        self._drawn_s = now_s
        self._measure(now_s, view)
        try:
            drawn = render(
                view,
                title=self._title,
                rates_hz=self._rates_hz,
                rows=rows,
                age_s=age_s,
                labels=self._labels,
            )
        except Exception as error:  # the run goes on, and its state is told all the same
            drawn = Text(f"{view.state.upper()}  not drawn: {type(error).__name__}: {error}", "bold red")
        self._live.update(drawn, refresh=True)

    def _measure(self, now_s: float, view: LoopView) -> None:
        """Work the rates out over the last second."""
        if self._counted is None:
            self._counted = (now_s, dict(view.counts))
            return
        since_s, counts = self._counted
        if now_s - since_s >= 1.0:
            self._rates_hz = {
                name: (count - counts.get(name, 0)) / (now_s - since_s) for name, count in view.counts.items()
            }
            self._counted = (now_s, dict(view.counts))
