"""Lay out the page, and put one moment on it."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Sequence
from html import escape
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

import numpy as np

from tega.errors import InvalidValueError
from tega.haptics import FINGERS
from tega.teleop.touch import STALE_NS
from tega.view.browser.charts import CourseChart, MuscleCharts
from tega.view.browser.delays import Delays
from tega.view.browser.ghost import GHOST_COLOUR
from tega.view.browser.scene import Point, Scene
from tega.view.browser.seek import SeekSlider
from tega.view.browser.style import STYLE
from tega.view.browser.timeline import KEPT_S, Timeline
from tega.view.browser.touch import GAP, TILE_HEIGHT, TILE_WIDTH, SmallSheet, TouchSheet
from tega.view.browser.vest import TRIED, vest_svg
from tega.view.labels import ContactLabels
from tega.view.run_state import MEANINGS, NO_NEWS, NO_NEWS_S, lines_beside

if TYPE_CHECKING:
    import viser

    from tega.teleop.moment import LoopView
    from tega.view.browser.controls import Controls
    from tega.view.state import ViewState

__all__ = ["Page"]

_TOUCH_WIDTH, _CHART_WIDTH = 420, 400
_POSES = ("open", "pre-shape", "half", "wrap", "tight")
_TYPE_COLOURS = {"none": "#868e96", "focal": "#e67700", "broad": "#0b7285", "mixed": "#495057"}
_STATE_COLOURS = {
    "idle": "#e8b500",
    "armed": "#1098ad",
    "active": "#2b8a3e",
    "hold": "#e8590c",
    "stopped": "#c92a2a",
}
_ARM_COLOURS = {"idle": "#868e96", "following": "#2b8a3e", "holding": "#e8590c", "stopped": "#c92a2a"}
_PAUSED = "#495057"
# Twice the time after which a block of muscles is late.
_SILENT_NS = 400_000_000
_FONT = "font-family:system-ui,sans-serif;font-size:12px;color:#343a40"


class Page:
    """Lays the page out and paints moments on it.

    Args:
        server: The viser server.
        title: Heading.
        controls: What the buttons set; ``None`` for a page on which nobody can tell whether the vest was on: pictures,
            scene and lines of text, and nothing of the vest, no measure of touch, no signal, no rate, no button.
        eye_m: Where the camera begins, world frame.
        at_m: What it looks at.
        kept_s: How far back one can look, seconds.

    Attributes:
        scene: The 3-D scene.
        run_state: Whether the run is idle, armed, active, in hold or stopped, and why.
        lights: A light for each device.
        arm: What the arm does, why, what the operator holds, and where the hand is; empty without an arm.
        status: The lines of text.
        timeline: The moments that can be looked back at; ``None`` on a page without controls.
        seek: The slider over a recording that is played; ``None`` where none is.
        inputs: viser's handles of the buttons and choices that there are: ``object``, ``haptics``, ``pause``, ``go``,
            ``undo``, ``stop``.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        *,
        title: str,
        controls: Controls | None,
        eye_m: Point,
        at_m: Point,
        kept_s: float = KEPT_S,
    ) -> None:
        gui = server.gui
        self._server, self._blind, self._controls = server, controls is None, controls
        self._sheet, self._labels, self._delays = TouchSheet(), ContactLabels(), Delays()
        self.timeline: Timeline | None = None
        self.seek: SeekSlider | None = None
        self._past_sheet: bytes | None = None
        self._small = SmallSheet()
        self.scene = Scene(server, eye_m=eye_m, at_m=at_m)
        self.inputs: dict[str, Any] = {}
        gui.configure_theme(show_logo=False, show_share_button=False, brand_color=(31, 95, 191))
        gui.set_panel_label(title)
        gui.add_html(STYLE)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(_CHART_WIDTH)
        self.run_state = gui.add_html("")
        self.lights = gui.add_html("")
        self._phone = gui.add_html("")
        self.arm = gui.add_html("")
        self.status = gui.add_html("")
        self._rates = gui.add_html("")
        if controls is not None:
            self._add_buttons(gui, controls)
            if controls.playhead is not None:
                self.seek = SeekSlider(gui, controls.playhead)
            self.timeline = Timeline(gui, kept_s)
            self._looking = gui.add_html("")
        self._muscles = MuscleCharts(gui)
        panel = gui.add_panel()
        with panel.add_tab("Fingertips" if self._blind else "Fingertips and vest"):
            self._captions = gui.add_html(_table([""] * len(FINGERS)) if self._blind else "")
            n = len(FINGERS)
            blank = np.full((2 * TILE_HEIGHT + GAP, n * TILE_WIDTH + (n - 1) * GAP, 3), 236, np.uint8)
            self._images = gui.add_image(blank, jpeg_quality=85)
            gui.add_html(_legend(_TOUCH_LEGEND) if self._blind else _legend(_TOUCH_LEGEND, _SCENE_LEGEND))
            if not self._blind:
                self._vest = gui.add_html(vest_svg(None))
                if controls is not None and controls.try_motor is not None:
                    hint = "while the run is armed, a click on a motor has it vibrate for half a second"
                    gui.add_html(
                        f'<div class="{TRIED}" style="{_FONT};font-size:11px;padding:0 10px">{hint}</div>'
                    )
                self._course = CourseChart(gui, kept_s)
        panel.dock_left()
        panel.set_width(_TOUCH_WIDTH)

    def _add_buttons(self, gui: viser.GuiApi, controls: Controls) -> None:
        if controls.objects:
            choice = self.inputs["object"] = gui.add_button_group("lift now", controls.objects)

            @choice.on_click
            def _(event: Any) -> None:
                with contextlib.suppress(InvalidValueError):  # the page offers others no more than these
                    controls.choose(event.target.value)

        if controls.can_mute:
            haptics = self.inputs["haptics"] = gui.add_checkbox("haptics on", initial_value=True)

            @haptics.on_update
            def _(event: Any) -> None:
                controls.haptics = event.target.value is True

        if controls.can_pause:
            pause = self.inputs["pause"] = gui.add_button("Pause", color="gray")

            @pause.on_click
            def _(event: Any) -> None:
                controls.paused = not controls.paused
                event.target.label = "Go on" if controls.paused else "Pause"

        if controls.can_go:
            go = self.inputs["go"] = gui.add_button("Go", color="green")
            go.on_click(lambda _event: controls.go())

        if (undo := controls.undo) is not None:
            button = self.inputs["undo"] = gui.add_button("Undo adaptation", color="gray")
            button.on_click(lambda _event: undo())

        stop = self.inputs["stop"] = gui.add_button("Stop", color="red")
        stop.on_click(lambda _event: controls.stop())

    def paint(
        self, state: ViewState, *, turn: int, rates_hz: dict[str, float], latency_ms: dict[str, float]
    ) -> None:
        """Put a moment on the page: the scene, and in turn pictures, text or charts.

        Args:
            state: The moment.
            turn: Whose turn it is, 0 to 2.
            rates_hz: Measured rates.
            latency_ms: Measured delays.
        """
        if not self._blind:
            self._course.note(state)
            self.paint_state(state.loop)
        sheet = None
        if turn == 0 and (state.images or self._blind):
            sheet = self._sheet.draw(state.images or {})
        if turn == 0 and self.timeline is not None:
            self.timeline.keep(state, sheet)
        past = self.paint_past()
        with self._server.atomic():
            if not past:
                self._draw_scene(state)
            if turn == 0:
                if sheet is not None and not past:
                    self._images.image = sheet
                    self._small.take(sheet)
            elif self._blind:
                self.status.content = _status(state)
            elif turn == 1:
                self.paint_text(state)
                if self.seek is not None:
                    self.seek.follow()
                if not past:
                    self._paint_touch(_captions(state, self._labels), self._torso(state))
                self._delays.note(latency_ms)
                self._rates.content = _rates(rates_hz) + self._delays.svg()
            elif not past:
                self._course.draw()
                if state.emg is not None:
                    self._muscles.draw(state.t_ns / 1e9, state.emg)

    def _draw_scene(self, state: ViewState) -> None:
        points, commanded = state.contact_points, None
        if self._blind:
            points = None  # who scores what is seen is told nothing that a camera does not see
        elif state.palm is not None and state.loop.target_rad is not None:
            commanded = state.loop.target_rad, state.palm
        self.scene.draw(state.shapes, state.poses, points, commanded)

    def _torso(self, state: ViewState) -> str:
        can_try = self._controls is not None and self._controls.try_motor is not None
        return vest_svg(state.loop.vest, can_try=can_try)

    def _paint_touch(self, captions: str, vest: str) -> None:
        self._captions.content, self._vest.content = captions, vest
        self._phone.content = f'<div class="tega-phone">{captions}{self._small.html}{vest}</div>'

    def paint_past(self) -> bool:
        """Show the moment that is looked back at, in pictures, scene and charts; the run's state stays that of now.

        Returns:
            Whether one is.
        """
        if self.timeline is None:
            return False
        past = self.timeline.shown()
        if past is None:
            if self._looking.content:
                self._looking.content, self._past_sheet = "", None
            return False
        state, sheet, emg = past
        with self._server.atomic():
            self._draw_scene(state)
            if sheet is not None and sheet is not self._past_sheet:
                import imageio.v3

                self._images.image = imageio.v3.imread(sheet)
                self._past_sheet = sheet
            # Labels of its own: those of now remember what came before.
            self._paint_touch(_captions(state, ContactLabels()), self._torso(state))
            self._course.draw(state.t_ns / 1e9)
            if emg is not None:
                self._muscles.draw(*emg)
            self._looking.content = (
                f'<div style="{_FONT};margin:2px 10px">{_badge("LOOKING BACK", _PAUSED)} pictures, scene, vest and '
                f"charts are of <b>{state.t_ns / 1e9:.1f} s</b>; the run goes on</div>"
            )
        return True

    def paint_state(
        self, loop: LoopView, *, age_s: float = 0.0, problem: str = "", paused: bool = False
    ) -> None:
        """Put the run's state on the page, which from then on says by itself how long it has heard nothing.

        Args:
            loop: The newest moment.
            age_s: How old it is.
            problem: What went wrong with the page.
            paused: Whether the page's button has the run stand still, so that no news is no bad news.
        """
        if not self._blind:
            beat = int(time.monotonic() * _BEATS_PER_S)
            controls = self._controls
            self.run_state.content = _run_state(
                loop,
                beat,
                age_s=age_s,
                problem=problem,
                paused=paused or (controls is not None and controls.paused),
                haptics=controls is None or controls.haptics,
            )

    def paint_text(self, state: ViewState) -> None:
        """Put the run's state and the lines of text on the page."""
        self.paint_state(state.loop)
        if not self._blind:
            self.arm.content = _arm(state.loop)
            self.lights.content = _lights(state)
        self.status.content = _status(state)


_TOUCH_LEGEND = (
    'above: cameras · below: touch map, <b style="color:#27a045">○</b> peak, '
    '<b style="color:#3b8cff">○</b> area that EDA counts'
)
_SCENE_LEGEND = (
    f'scene: <b style="color:{GHOST_COLOUR}">blue, translucent</b> the hand as commanded · red arrows: forces'
)


def _legend(*lines: str) -> str:
    style = f"{_FONT};font-size:11px;line-height:1.4;padding:0 10px;color:#6c757d"
    return f'<div style="{style}">{"<br>".join(lines)}</div>'


# How often the run's state is painted afresh, also where nothing in it changes: the browser greys one that is not.
_BEATS_PER_S = 2


def _run_state(
    view: LoopView,
    beat: int = 0,
    *,
    age_s: float = 0.0,
    problem: str = "",
    paused: bool = False,
    haptics: bool = True,
) -> str:
    """Say the run's state first, as the terminal does, where there is a guard; and that nothing was heard."""
    ended = view.state == "stopped"
    late, lines = "", []
    paused = paused and not ended
    if paused:
        lines.append(_badge("PAUSED", _PAUSED) + " <b>paused by the page's button</b>")
    elif not ended:
        words = f"{NO_NEWS} " + (f"{age_s:.0f} s" if age_s >= NO_NEWS_S else "<span></span>")
        shown = ' style="visibility:visible;max-height:3em"' if age_s >= NO_NEWS_S else ""
        late = f'<b class="tega-late"{shown}>{words}: what stands here may no longer be so</b>'
    if problem:
        lines.append(f'<span style="color:#e8590c">! {escape(problem)}</span>')
    if view.state:
        reason, alerts = lines_beside(view)
        if not paused:
            ageing = "" if ended else ' class="tega-badge"'
            badge = _badge(view.state.upper(), _STATE_COLOURS[view.state], ageing)
            lines.append(f"{badge} {escape(MEANINGS[view.state])}")
        if not haptics and not ended:
            lines.append(_badge("HAPTICS OFF", _PAUSED) + " switched off on this page: every motor rests")
        if reason:
            lines.append(f"<b>{escape(reason)}</b>")
        lines += [f'<span style="color:#e8590c">! {escape(alert)}</span>' for alert in alerts]
    style = f"--tega-since:{age_s:.1f}s;{_FONT};margin:4px 10px;line-height:1.6"
    return f'<div data-beat="{beat}" style="{style}">{late}{"<br>".join(lines)}</div>'


def _badge(text: str, colour: str, more: str = "") -> str:
    return f'<b{more} style="background:{colour};color:#fff;padding:1px 8px;border-radius:3px">{text}</b>'


def _lights(state: ViewState) -> str:
    """Show a light for each part of the run: green where something fresh came, orange where not, grey without one."""
    loop = state.loop
    seen: dict[str, bool | None] = {}
    for finger in FINGERS:
        contact = loop.contacts.get(finger)
        seen[finger] = None if contact is None else state.t_ns - contact[0] <= STALE_NS
    seen["muscles"] = None if loop.block is None else state.t_ns - loop.block[0] <= _SILENT_NS
    seen["vest"] = None if loop.vest is None else True
    seen["hand"] = None if loop.angles_rad is None and state.poses is None else True
    if loop.arm or loop.seen_arm is not None:
        seen["arm"] = loop.seen_arm is not None and loop.seen_arm.state != "stopped"
    if loop.link:
        seen["link"] = True
    words = {True: ("#2b8a3e", "well"), False: ("#e8590c", "silent"), None: ("#ced4da", "absent")}
    cells = " ".join(
        f'<span style="white-space:nowrap" title="{name}: {words[well][1]}">'
        f'<b style="color:{words[well][0]}" aria-label="{words[well][1]}">●</b> {name}</span>'
        for name, well in seen.items()
    )
    # A new element each time, so that the browser counts anew from when it last heard something.
    return (
        f'<div class="tega-lights" data-t="{state.t_ns}" '
        f'style="{_FONT};font-size:11px;margin:2px 10px;line-height:1.6">'
        f"{cells}</div>"
    )


def _arm(view: LoopView) -> str:
    """Say what the arm does as the run's state is said; nothing without an arm."""
    style = f"{_FONT};margin:4px 10px;line-height:1.6"
    if view.state == "stopped" and view.arm:
        # The last moment is from before the arm was let go, and the page stays open.
        return f'<div style="{style}"><b>arm</b> led no more: the run has ended</div>'
    if (arm := view.seen_arm) is None:
        return f'<div style="{style}"><b>arm</b> {escape(view.arm)}</div>' if view.arm else ""
    health = arm.health
    took = "" if health.success_rate is None else f" · robot took {100 * health.success_rate:.0f} %"
    lines = (
        f'<b style="background:{_ARM_COLOURS[arm.state]};color:#fff;padding:1px 8px;border-radius:3px">'
        f"ARM {arm.state.upper()}</b> {escape(arm.reason)}",
        f"{arm.switches} · hand at {arm.place}",
        f'<span style="color:#868e96">the arm\'s loop: {escape(arm.phase)}, {health.rate_hz:.0f} Hz, worst '
        f"{health.worst_ms:.0f} ms, {health.refused} commands refused{took}</span>",
    )
    return f'<div style="{style}">{"<br>".join(lines)}</div>'


def _status(state: ViewState) -> str:
    block = state.loop.block
    rows = {"time": f"{state.t_ns / 1e9:.1f} s", **state.rows}
    if block is not None:
        rows["hand"] = f"level {block[2]}: {_POSES[block[2] - 1]}"
        rows["muscles"] = "levels " + " · ".join(str(level) for level in block[1])
    if newest := state.loop.newest_event:
        rows["touch"] = newest
    if state.loop.vest_condition:
        rows["vest"] = state.loop.vest_condition
    rows |= {name.replace("_", " "): seen.words(name) for name, seen in state.loop.inputs.items()}
    pairs = [
        f'<td style="color:#868e96;padding-right:8px">{escape(name)}</td>'
        f'<td style="padding-right:14px"><b>{escape(text)}</b></td>'
        for name, text in rows.items()
    ]
    # Two pairs a line, in columns: the first half on the left.
    half = (len(pairs) + 1) // 2
    lines = "".join(
        f"<tr>{left}{right}</tr>" for left, right in zip_longest(pairs[:half], pairs[half:], fillvalue="")
    )
    return f'<table style="{_FONT};margin:2px 8px;line-height:1.5">{lines}</table>'


def _captions(state: ViewState, labels: ContactLabels) -> str:
    cells = []
    for finger, felt in zip(FINGERS, state.loop.felt, strict=True):
        contact = state.loop.contacts.get(finger)
        if contact is None:
            text = '<span style="color:#adb5bd">no sensor</span>'
        elif state.t_ns - contact[0] > STALE_NS:
            text = '<b style="color:#e67700">silent:</b><br>no fresh<br>picture'
        else:
            kind = labels.name(finger, felt, in_contact=contact[1].in_contact)
            word = "no contact" if kind == "none" else kind
            text = (
                f"CCI {felt.cci_norm:.2f}<br>EDA {felt.eda_norm:.2f}<br>"
                f'<b style="color:{_TYPE_COLOURS[kind]}">{word}</b>'
            )
        cells.append(text)
    return _table(cells)


def _table(texts: Sequence[str]) -> str:
    """Put a text under each finger's name."""
    cells = [
        f'<td style="width:25%;text-align:center;line-height:1.35"><b>{finger}</b><br>{text}</td>'
        for finger, text in zip(FINGERS, texts, strict=True)
    ]
    style = f"{_FONT};width:100%;table-layout:fixed;margin-top:-10px;padding:0 8px"
    return f'<table style="{style}"><tr>{"".join(cells)}</tr></table>'


def _rates(rates_hz: dict[str, float]) -> str:
    rates = " · ".join(f"{escape(name)} {rate:.0f} Hz" for name, rate in rates_hz.items())
    return f'<div style="{_FONT};font-size:11px;color:#6c757d;padding:2px 10px">{rates}</div>'
