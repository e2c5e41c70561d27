"""Lay out the browser's page, and put one moment of a run on it."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from typing import Any

import viser

from tega.errors import InvalidValueError
from tega.haptics import FINGERS
from tega.loop.snapshot import LoopView
from tega.ui.view.browser.charts import CourseChart, Delays, MuscleCharts
from tega.ui.view.browser.controls import Controls
from tega.ui.view.browser.pictures import CameraPictures, TouchSheet, cameras_html, picture_html
from tega.ui.view.browser.scene import Point, Scene
from tega.ui.view.browser.state_html import (
    BEATS_PER_S,
    FONT,
    LEGEND,
    PAUSED,
    STOP_MARK,
    STYLE,
    arm_html,
    badge_html,
    captions_html,
    lights_html,
    rates_html,
    run_state_html,
    status_html,
)
from tega.ui.view.browser.timeline import KEPT_S, SeekSlider, Timeline, add_annotation_keys
from tega.ui.view.browser.vest import TRIED, vest_svg
from tega.ui.view.run_state import ContactLabels
from tega.ui.view.state import ViewState

_TOUCH_WIDTH, _CHART_WIDTH = 420, 400
_SHEET = "cameras and touch maps"
_RED, _GREY = (201, 42, 42), (73, 80, 87)  # white is legible on them, unlike on viser's own


class Page:
    """Lays the page out and paints moments on it.

    ``eye_m`` is the initial position of the camera, world frame, ``at_m`` the point that it looks at. The
    page can look back ``kept_s``. ``run_state``, ``lights``, ``arm`` and ``status`` are viser's handles of the texts;
    ``timeline`` has the moments that can be looked back at, ``seek`` is the slider over a recording that is played,
    ``None`` where none is. ``inputs`` are the handles of the buttons and choices that there are: ``object``,
    ``haptics``, ``reflex``, ``pause``, ``go``, ``undo``, ``rezero``, ``stop``.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        *,
        title: str,
        controls: Controls,
        eye_m: Point,
        at_m: Point,
        kept_s: float = KEPT_S,
    ) -> None:
        gui = server.gui
        self._server, self._controls = server, controls
        self._sheet, self._labels, self._delays = TouchSheet(), ContactLabels(), Delays()
        self.seek: SeekSlider | None = None
        self._past_ns: int | None = None
        self._ended = False
        self.scene = Scene(server, eye_m=eye_m, at_m=at_m)
        self.inputs: dict[str, Any] = {}
        gui.configure_theme(show_logo=False, show_share_button=False, brand_color=(31, 95, 191))
        gui.set_panel_label(title)
        gui.add_html(STYLE)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(_CHART_WIDTH)
        # First of all, and it stays in sight while the panel, or a phone's sheet, is scrolled.
        gui.add_html(STOP_MARK)
        self._add_button("stop", "Stop", _RED, controls.stop)
        self.run_state = gui.add_html("")
        self.lights = gui.add_html("")
        self._phone = gui.add_html("")
        self.arm = gui.add_html("")
        self.status = gui.add_html("")
        self._rates = gui.add_html("")
        self._add_buttons(gui, controls)
        if controls.playhead is not None:
            self.seek = SeekSlider(gui, controls.playhead)
        if controls.annotate is not None:
            add_annotation_keys(gui, controls.annotate)
        self.timeline = Timeline(gui, kept_s)
        self._looking = gui.add_html("")
        self.cameras = CameraPictures(gui)
        self._muscles = MuscleCharts(gui)
        panel = gui.add_panel()
        with panel.add_tab("Fingertips and vest"):
            self._captions = gui.add_html("")
            self._pictures = gui.add_html(picture_html(self._sheet.draw({}), _SHEET))
            gui.add_html(LEGEND)
            self._vest = gui.add_html(vest_svg(None))
            if controls.try_motor is not None:
                hint = "while the run is armed, a click on a motor has it vibrate for half a second"
                gui.add_html(
                    f'<div class="{TRIED}" style="{FONT};font-size:11px;padding:0 10px">{hint}</div>'
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

        if (share := controls.reflex) is not None:
            dial = self.inputs["reflex"] = gui.add_slider(
                "reflex authority", min=0.0, max=1.0, step=0.05, initial_value=share
            )

            @dial.on_update
            def _(event: Any) -> None:
                controls.reflex = event.target.value

        if controls.can_pause:
            pause = self.inputs["pause"] = gui.add_button("Pause", color=_GREY)

            @pause.on_click
            def _(event: Any) -> None:
                controls.paused = not controls.paused
                event.target.label = "Go on" if controls.paused else "Pause"

        if controls.can_go:
            self._add_button("go", "Go", "green", controls.go)
            self._offer_go(ready=False)
        if controls.undo is not None:
            self._add_button("undo", "Undo adaptation", _GREY, controls.undo)
        if controls.rezero is not None:
            self._add_button("rezero", "New baseline", _GREY, controls.rezero)

    def _add_button(self, name: str, label: str, colour: Any, action: Callable[[], None]) -> None:
        button = self.inputs[name] = self._server.gui.add_button(label, color=colour)
        button.on_click(lambda _event: action())

    def paint(
        self, state: ViewState, *, turn: int, rates_hz: dict[str, float], latency_ms: dict[str, float]
    ) -> None:
        """Put a moment on the page: the scene, and in turn pictures, text or charts."""
        self._course.note(state)
        self.paint_state(state.loop)
        sheet = filmed = None
        if turn == 0:
            if state.images:
                sheet = picture_html(self._sheet.draw(state.images, state.loop.fingers), _SHEET)
            filmed = cameras_html(state.cameras)
            self.timeline.keep(state, sheet, filmed)
        past = self.paint_past()
        with self._server.atomic():
            if not past:
                self._draw_scene(state)
            if turn == 0 and not past:
                self._draw_pictures(sheet, filmed)
            elif turn == 1:
                self.paint_text(state)
                if self.seek is not None:
                    self.seek.follow()
                if not past:
                    self._paint_touch(captions_html(state, self._labels), self._torso(state))
                self._delays.note(latency_ms)
                self._rates.content = rates_html(rates_hz, state.loop.latency) + self._delays.svg()
            elif turn == 2 and not past:
                self._course.draw()
                if state.emg is not None:
                    self._muscles.draw(state.t_ns / 1e9, state.emg)

    def _draw_pictures(self, sheet: str | None, filmed: str | None) -> None:
        if sheet is not None:
            self._pictures.content = sheet
        self.cameras.draw(filmed)

    def _draw_scene(self, state: ViewState) -> None:
        commanded = None
        if state.palm is not None and state.loop.target_rad is not None:
            commanded = state.loop.target_rad, state.palm
        self.scene.draw(state.shapes, state.poses, state.contact_points, commanded)

    def _torso(self, state: ViewState) -> str:
        names = FINGERS if state.loop.fingers == FINGERS else "1234"
        return vest_svg(state.loop.vest, names=names, can_try=self._controls.try_motor is not None)

    def _paint_touch(self, captions: str, vest: str) -> None:
        if self._ended:
            captions, vest = (f'<div class="tega-ended">{html}</div>' for html in (captions, vest))
        self._captions.content, self._vest.content = captions, vest
        self._phone.content = f'<div class="tega-phone">{captions}{self._pictures.content}{vest}</div>'

    def paint_past(self) -> bool:
        """Show the moment that is looked back at, in pictures, scene and charts; return whether there is one."""
        past = self.timeline.displayed()
        if past is None:
            if self._looking.content:
                self._looking.content, self._past_ns = "", None
            return False
        state, sheet, filmed, emg = past
        with self._server.atomic():
            self._draw_scene(state)
            if state.t_ns != self._past_ns:
                self._past_ns = state.t_ns
                self._draw_pictures(sheet, filmed)
            # Labels of its own: those of now remember what came before.
            self._paint_touch(captions_html(state, ContactLabels()), self._torso(state))
            self._course.draw(state.t_ns / 1e9)
            if emg is not None:
                self._muscles.draw(*emg)
            self._looking.content = (
                f'<div style="{FONT};margin:2px 10px">{badge_html("LOOKING BACK", PAUSED)} pictures, scene, vest and '
                f"charts are of <b>{state.t_ns / 1e9:.1f} s</b>; the run goes on</div>"
            )
        return True

    def paint_state(self, loop: LoopView, *, age_s: float = 0.0, problem: str = "") -> None:
        """Show the run's state; the page then reports by itself for how long it has received nothing.

        ``loop`` is the newest moment, ``age_s`` old; ``problem`` is the page's, ``""`` for none.
        """
        self._ended = loop.state == "stopped"
        self._offer_go(ready=loop.state == "armed" and not self._controls.may_go)
        for name in ("haptics", "reflex", "pause", "undo"):
            if (control := self.inputs.get(name)) is not None and control.disabled != self._ended:
                control.disabled = self._ended
        self.run_state.content = run_state_html(
            loop,
            int(time.monotonic() * BEATS_PER_S),
            age_s=age_s,
            problem=problem,
            paused=self._controls.paused,  # so that no news is no bad news
            haptics=self._controls.haptics,
        )

    def _offer_go(self, *, ready: bool) -> None:
        """Let Go be pressed only while an armed run waits for it; a run that steers already is not offered it."""
        go = self.inputs.get("go")
        if go is not None and go.disabled == ready:
            go.disabled, go.color = not ready, "green" if ready else "gray"

    def paint_last(self, state: ViewState) -> None:
        """Put the end of a run on the page: nothing that it shows moves any more."""
        self.paint_text(state)
        self._paint_touch(captions_html(state, self._labels), self._torso(state))
        self._draw_scene(state)

    def paint_text(self, state: ViewState) -> None:
        """Put the run's state and the lines of text on the page."""
        self.paint_state(state.loop)
        self.arm.content = arm_html(state.loop)
        self.lights.content = lights_html(state)
        self.status.content = status_html(state)
