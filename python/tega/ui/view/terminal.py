"""Show a run live in the terminal: fingers, vest, muscles, hand and rates, within the terminal's height and width."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Self

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from tega.haptics import CONTACT_RULES
from tega.loop.snapshot import LoopView, Snapshot
from tega.loop.touch import STALE_NS
from tega.records.bus import Backlog, Bus
from tega.records.display import DisplayRows
from tega.ui.view.run_state import (
    NO_NEWS,
    NO_NEWS_S,
    ContactLabels,
    RateMeter,
    device_rows,
    lines_beside,
    meaning,
)

_WIDEST, _WIDE, _TALL = 120, 104, 30
_REFRESH_S = 0.1
_MOST_ALERTS = 2
_STATE_STYLES = {
    "idle": "black on yellow",
    "armed": "black on cyan",
    "active": "black on green",
    "hold": "black on dark_orange",
    "stopped": "white on red",
}
_CONTACT_COLOURS = {"none": "grey50", "focal": "bold yellow", "broad": "bold cyan", "mixed": "white"}
_SHADES = " ·░▒▓█"


def _bar(share: float, colour: str, width: int) -> Text:
    filled = round(min(max(share, 0.0), 1.0) * width)
    return Text("█" * filled, style=colour) + Text("─" * (width - filled), style="grey37")


def _touch(view: LoopView, labels: ContactLabels, *, bar: int) -> Table:
    table = Table(box=None, padding=(0, 1), expand=False)
    for name in ("", "CCI (front) %", "EDA (back) %", "contact"):
        table.add_column(name, no_wrap=True)
    for finger in view.fingers:
        contact = view.contacts.get(finger)
        if contact is None:
            table.add_row(finger, Text("no sensor", style="grey50"))
            continue
        if view.t_ns - contact.t_ns > STALE_NS:
            # Never the last value: the contact now is unknown.
            table.add_row(finger, Text("no data", style="bold yellow"))
            continue
        kind = labels.name(contact)
        table.add_row(
            finger,
            _bar(contact.cci_norm, "blue", bar) + Text(f" {contact.front:3.0f}"),
            _bar(contact.eda_norm, "green", bar) + Text(f" {contact.back:3.0f}"),
            Text(f"{kind:<6}", style=_CONTACT_COLOURS[kind]),
        )
    return table


def _motors(intensities: Sequence[int], *, each: int) -> list[Text]:
    """Draw the motors of a face, a text for each row of four, from the wearer's left to right."""
    rows = []
    for start in range(0, len(intensities), 4):
        row = Text()
        for value in intensities[start : start + 4]:
            shade = _SHADES[min(len(_SHADES) - 1, -(-value * (len(_SHADES) - 1) // 100))]
            row.append(shade * each, style="red" if value >= 60 else "magenta").append(" ")
        rows.append(row)
    return rows


def _inputs(view: LoopView) -> Text:
    text = Text()
    for name, seen in view.inputs.items():
        style = "bold red" if not seen.state.live else "bold green" if seen.held else "grey70"
        text.append(f"{name.replace('_', ' ')} ", "grey50").append(f"{seen.words(name)}   ", style)
    return text


def _arm(view: LoopView) -> Text:
    text = Text.assemble((f"arm   {view.arm}", "bold"))
    if (arm := view.seen_arm) is not None:
        text.append(f"\n      {arm.switches}; hand at {arm.place}", "grey70")
    return text


def _state(view: LoopView, *, late: bool, most_alerts: int | None) -> Text:
    style = "white on grey50" if late else _STATE_STYLES[view.state]
    text = Text.assemble((f" {view.state.upper()} ", f"bold {style}"), f" {meaning(view)}")
    reason, alerts = lines_beside(view)
    if reason:
        text.append(f"\n{reason}", "bold yellow")
    for alert in alerts[:most_alerts]:
        text.append(f"\n! {alert}", "yellow")
    if more := len(alerts[len(alerts[:most_alerts]) :]):
        text.append(f"\n! {more} more: enlarge the terminal", "yellow")
    return text


def render(
    view: LoopView,
    *,
    title: str,
    rates_hz: Mapping[str, float],
    rows: Mapping[str, str] = {},
    age_s: float = 0.0,
    labels: ContactLabels | None = None,
    address: str = "",
    width: int = 80,
    height: int = 24,
) -> RenderableType:
    """Draw one moment of the loop; one that is old by ``age_s`` is marked, unless it is the last.

    ``rates_hz`` are measured, by name; ``rows`` are further texts by name, one line in all. ``labels`` names
    the contacts with hysteresis. ``address`` is the page's, shown in the frame. Up to 120 columns of the
    terminal's ``width`` are used; a ``height`` of 24 lines is enough for state, fingers, vest, muscles, hand,
    rates and latency.
    """
    wide, tall = width >= _WIDE, height >= _TALL
    late = age_s >= NO_NEWS_S and view.state != "stopped"
    lines: list[RenderableType] = []
    if late:
        lines.append(Text(f"{NO_NEWS} {age_s:.0f} s: the values below may be out of date", "bold red"))
    if view.state:
        lines.append(_state(view, late=late, most_alerts=None if tall else _MOST_ALERTS))
    if rows:
        pairs = (((f"{name} ", "grey50"), (f"{value}   ", "bold")) for name, value in rows.items())
        lines.append(Text.assemble(*(part for pair in pairs for part in pair)))
    touch = _touch(view, labels or ContactLabels(), bar=14 if wide else 18)
    motors = [] if view.vest is None else [int(v) for v in view.vest.intensities]
    half = len(motors) // 2
    faces = {"front": motors[:half], "back": motors[half:]} if motors else {}
    beside = wide and view.vest is not None  # else a face of the vest is a line below
    if beside:
        grid, panels = Table.grid(padding=(0, 2)), Table.grid(padding=(0, 1))
        drawn = ((name, Text("\n").join(_motors(face, each=3))) for name, face in faces.items())
        panels.add_row(*(Panel(text, title=name, width=20) for name, text in drawn))
        grid.add_row(touch, panels)
        touch = grid
    rule = f"focal: {CONTACT_RULES['focal']}\nbroad: {CONTACT_RULES['broad']}"
    style = "grey50" if view.state == "stopped" else ""
    devices = {
        name: Text.assemble((f"{name:<8}", "grey50"), (text, style))
        for name, text in device_rows(view).items()
    }
    lines += [touch, *([Text(rule, style="grey50")] if tall else []), devices["vest"]]
    if not beside:
        bars = ((name, Text("│", "grey37").join(_motors(face, each=2))) for name, face in faces.items())
        lines += [Text(f"  {name:<6}", "grey70") + bar for name, bar in bars]
    rates = "   ".join(f"{name} {rate:.0f} Hz" for name, rate in rates_hz.items())
    lines += [devices["muscles"], devices["hand"], Text(f"{view.t_ns / 1e9:6.1f} s   {rates}", "grey70")]
    lines += [Text(view.latency, "grey70")] if view.latency else []
    lines += [Text(f"touch   {view.newest_event}", "bold")] if view.newest_event else []
    lines += [Text(f"reflex  {view.reflex}")] if view.reflex else []
    lines += [_inputs(view)] if view.inputs else []
    lines += [_arm(view)] if view.arm else []
    lines += [Text(f"link    {view.link}")] if view.link else []
    return Panel(
        Group(*lines),
        title=Text(title),  # else what a name or an IPv6 address has in brackets is markup
        title_align="left",
        subtitle=Text(address) if address else None,
        subtitle_align="left",
        width=min(width, _WIDEST),
    )


class TerminalView:
    """Shows the loop while it runs; gives up frames rather than keep the loop waiting.

    Use as a context manager. Moments are drawn in a thread of its own: drawing takes longer than a tick of the hand.
    The refresh and the shown rates go by ``now_s``. ``address`` is that of the page in the browser, shown in the frame;
    empty without one.
    """

    def __init__(
        self, title: str, *, console: Console | None = None, now_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._title, self.address = title, ""
        self._now_s = now_s
        self._live = Live(console=console or Console(stderr=True), auto_refresh=False, transient=True)
        self._drawn_s = -_REFRESH_S
        self._meter = RateMeter()
        self._labels = ContactLabels()
        self._newest: tuple[LoopView, Mapping[str, str], float] | None = None
        self._waiting = Backlog("view", most=1, newest=True, idle=self._redraw)

    def __enter__(self) -> Self:
        """Take the screen."""
        self._live.start()
        self._waiting.start()
        return self

    def __exit__(self, *_error: object) -> None:
        """Give the screen back."""
        self._waiting.close()
        self._live.stop()

    def watch(self, bus: Bus) -> None:
        """Show the moments of a run from now on."""
        rows = DisplayRows(bus, "terminal")

        def take(snapshot: Snapshot) -> None:
            self._take((snapshot.view, rows()))

        bus.subscribe(Snapshot, take, name="display", backlog=self._waiting)

    def offer(self, view: LoopView, rows: Mapping[str, str] = {}) -> None:
        """Take a moment to be shown, with further texts by name; returns at once."""
        self._waiting.put(TerminalView._take, self, (view, rows))

    def _take(self, given: tuple[LoopView, Mapping[str, str]]) -> None:
        self._newest = (*given, time.monotonic() - self._waiting.waited_s)
        self._redraw()

    def _redraw(self) -> None:
        if self._newest is not None:
            view, rows, came_s = self._newest
            self(view, rows, age_s=time.monotonic() - came_s)

    def __call__(self, view: LoopView, rows: Mapping[str, str] = {}, *, age_s: float = 0.0) -> None:
        """Draw a moment with further texts and its age, unless one was drawn less than 0.1 s ago.

        If drawing fails, the screen shows the error, and drawing goes on with the next moment.
        """
        now_s = self._now_s()
        if now_s - self._drawn_s < _REFRESH_S:
            return
        self._drawn_s = now_s
        self._meter.take(now_s, view.counts)
        try:
            width, height = self._live.console.size
            drawn = render(
                view,
                title=self._title,
                rates_hz=self._meter.rates_hz,
                rows=rows,
                age_s=age_s,
                labels=self._labels,
                address=self.address,
                width=width,
                height=height,
            )
        except Exception as error:  # the run goes on, and its state is still shown
            drawn = Text(f"{view.state.upper()}  not drawn: {type(error).__name__}: {error}", "bold red")
        self._live.update(drawn, refresh=True)
