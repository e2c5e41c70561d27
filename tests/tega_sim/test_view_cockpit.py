"""The page tells the state as it is, has lights and delays, draws the hand as commanded, and looks back."""

from __future__ import annotations

import re
import urllib.error
import urllib.request
import xml.etree.ElementTree as ET
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import click
import numpy as np
import pytest
from click.testing import CliRunner
from msgspec.structs import replace

pytest.importorskip("viser", reason="needs the extra view")

from reference.moments import Moments, completed
from reference.processes import until
from tega.hand import CLOSURE_POSES_RAD
from tega.haptics import vest_frame
from tega.loop.hand import ModelledAllegro
from tega.ui.cli.page import browser_observer, view_options
from tega.ui.view.browser import BrowserView, Controls
from tega.ui.view.browser.charts import BUDGET_MS, COURSE_S, CourseChart, Delays
from tega.ui.view.browser.hand_figure import STANDING, HandFigure
from tega.ui.view.browser.pictures import picture_html
from tega.ui.view.browser.state_html import lights_html, run_state_html
from tega.ui.view.browser.timeline import Timeline
from tega.ui.view.browser.vest import vest_svg

PALM = np.array([0.3, -0.2, 0.5, np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0])


@pytest.fixture(scope="module")
def snapshot() -> Any:
    return Moments().at(2.0)


def test_a_paused_run_is_not_called_active_and_haptics_off_is_said(snapshot: Any) -> None:
    loop = snapshot.loop._replace(state="active", reason="all devices ready")
    assert ">ACTIVE<" in run_state_html(loop)
    paused = run_state_html(loop, paused=True)
    assert ">PAUSED<" in paused
    assert "ACTIVE" not in paused
    assert ">HAPTICS OFF<" in run_state_html(loop, haptics=False)
    stopped = loop._replace(state="stopped", reason="the page's button")
    message = run_state_html(stopped, paused=True, haptics=False)
    assert ">STOPPED<" in message
    assert "the page&#x27;s button" in message
    assert "PAUSED" not in message
    assert "HAPTICS" not in message


def test_the_page_itself_says_so_and_a_phone_is_given_touch_and_vest(snapshot: Any) -> None:
    controls = Controls(can_pause=True, can_mute=True)
    with BrowserView("a run", port=0, controls=controls) as view:
        controls.paused, controls.haptics = True, False
        view.offer(snapshot._replace(loop=snapshot.loop._replace(state="active")))
        until(lambda: "PAUSED" in view.page.run_state.content)
        assert "HAPTICS OFF" in view.page.run_state.content
        until(lambda: "thumb" in view.page.lights.content)
        until(lambda: 'src="data:image/jpeg' in view.page._phone.content)
        assert view.page._phone.content.startswith('<div class="tega-phone">')
        assert view.page._phone.content.count("<circle") == 40


def test_a_light_tells_a_silent_finger_from_an_absent_one(snapshot: Any) -> None:
    thumb = snapshot.loop.contacts["thumb"]
    contacts = dict(snapshot.loop.contacts) | {"thumb": replace(thumb, t_ns=thumb.t_ns - 10**9)}
    del contacts["ring"]
    lost = frozenset({"vest", "link"})
    loop = snapshot.loop._replace(contacts=contacts, troubled=lost, link="leads", devices=frozenset({"hand"}))
    lights = lights_html(snapshot._replace(loop=loop))
    for name, sign, word in (("thumb", "▲", "fault"), ("index", "●", "well"), ("ring", "○", "absent")):
        assert re.search(f'title="{name}: {word}".*?>{sign}</b> {name}<', lights)
    assert all(f'title="{name}: fault"' in lights for name in (*lost, "hand"))


def test_the_wearers_left_is_on_the_right_of_the_front_and_on_the_left_of_the_back() -> None:
    drawing = vest_svg(vest_frame([80, 0, 0, 0], [0, 0, 0, 55], layout="x40"))
    root = ET.fromstring(drawing)
    texts = [(node.text, float(node.attrib["x"])) for node in root.iter("text")]
    (thumb_front, thumb_back) = [x for text, x in texts if text == "thumb"]
    lefts = [x for text, x in texts if text == "L"]
    rights = [x for text, x in texts if text == "R"]
    assert rights[0] < lefts[0] < lefts[1] < rights[1]
    assert abs(thumb_front - lefts[0]) < abs(thumb_front - rights[0])
    assert abs(thumb_back - lefts[1]) < abs(thumb_back - rights[1])
    # The column that vibrates is below its finger's name.
    assert {x for text, x in texts if text == "80"} == {thumb_front}
    assert len([node for node in root.iter("rect") if node.attrib.get("height") == "7"]) == 16


def test_delays_have_their_percentile_and_the_budget() -> None:
    delays = Delays()
    for k in range(1, 101):
        delays.note({"picture to vest": float(k), "to the page": 500.0})
    assert delays.p99_ms("picture to vest") == 99.0
    few = Delays()
    few.note({"picture to vest": 40.0})
    assert few.words("picture to vest") == "40 ms · worst 40 (n 1)"
    svg = delays.svg()
    assert f"p99 99 (n 100) · budget {BUDGET_MS:.0f}" in svg
    assert "p99 500 (n 100)</text>" in svg
    assert svg.count("<line ") == 1
    ET.fromstring(svg)


def test_an_address_for_a_second_screen_is_asked_for_with_its_token() -> None:
    urls: list[str] = []

    @click.command()
    @view_options
    def show(**_options: object) -> None:
        with browser_observer("a run", port=0) as page:
            urls.append(page.url)
            with pytest.raises(urllib.error.HTTPError, match="403"):
                urllib.request.urlopen(page.url.rsplit("/", 2)[0] + "/", timeout=10)
            assert urllib.request.urlopen(page.url, timeout=10).status == 200

    assert CliRunner().invoke(show, ["--view-address", "0.0.0.0"], catch_exceptions=False).exit_code == 0
    assert CliRunner().invoke(show, ["--view-address", ""]).exit_code == 2
    assert CliRunner().invoke(show, [], catch_exceptions=False).exit_code == 0
    assert not urls[0].startswith("http://0.0.0.0:")
    assert urls[1].startswith("http://127.0.0.1:")


def test_a_hand_tells_where_it_steers_to_before_it_is_there() -> None:
    hand = ModelledAllegro()
    for _ in range(60):
        hand.step(5)
    target = hand.target_rad
    assert target is not None
    route = CLOSURE_POSES_RAD[4] - CLOSURE_POSES_RAD[0]
    assert (target - hand.angles_rad) @ route > 0.01
    for _ in range(1500):
        hand.step(5)
    np.testing.assert_allclose(np.array(hand.target_rad), CLOSURE_POSES_RAD[4], atol=1e-9)


def test_a_figure_goes_where_its_palm_goes() -> None:
    figure = HandFigure()
    standing, led = figure.poses(CLOSURE_POSES_RAD[2]), figure.poses(CLOSURE_POSES_RAD[2], PALM)
    apart = np.linalg.norm(standing[:, None, :3] - standing[None, :, :3], axis=2)
    np.testing.assert_allclose(np.linalg.norm(led[:, None, :3] - led[None, :, :3], axis=2), apart, atol=1e-8)
    # What was up is along the world's x: the palm was turned by a right angle about y.
    route = standing[:, :3] - STANDING[:3]
    np.testing.assert_allclose(
        led[:, :3] - PALM[:3], np.stack([route[:, 2], route[:, 1], -route[:, 0]], 1), atol=1e-8
    )


def test_in_the_simulated_world_both_hands_coincide_where_the_command_is_what_is_measured() -> None:
    pytest.importorskip("mujoco", reason="the simulated world needs the extra sim")
    from tega_sim.world import World

    world, figure = World("bottle", seed=1), HandFigure()
    shapes, poses = world.shapes(), world.poses()
    ours = figure.poses(world.angles_rad, world.palm_row)
    for finger in ("thumb", "index", "middle", "ring"):
        (there,) = (row for shape, row in zip(shapes, poses, strict=True) if shape[0] == f"{finger}_pad")
        (here,) = (row for shape, row in zip(figure.shapes, ours, strict=True) if shape[0] == f"{finger}_pad")
        np.testing.assert_allclose(here[:3], there[:3], atol=1e-4)


def test_a_run_s_moments_tell_it_and_the_page_draws_it_while_there_is_a_command(tmp_path: Path) -> None:
    emg = {"driver": "synthetic-emg", "kind": "raw", "options": {"seed": 1, "duration_s": 3.0}}
    seen: list[Any] = completed({"session": {"pace": "fast"}, "emg": emg}, tmp_path)
    moved = [s for s in seen if s.loop.target_rad is not None]
    assert len(moved) > 80
    gaps = [np.abs(np.array(s.loop.target_rad) - np.array(s.loop.angles_rad)).max() for s in moved]
    assert max(gaps) > 0.02
    for state in moved:
        np.testing.assert_array_equal(state.palm, STANDING)
    paint: dict[str, Any] = {"rates_hz": {}, "latency_ms": {}}
    with BrowserView(port=0) as view:
        for k in range(3):
            view.page.paint(moved[0], turn=k, **paint)
        names = [handle.name for handle, _ in view.page.scene.ghost.solids.batches]
        assert names == ["/commanded/ball", "/commanded/tube"]
        view.page.paint(moved[0]._replace(loop=moved[0].loop._replace(target_rad=None)), turn=0, **paint)
        assert view.page.scene.ghost.solids.batches == []


class Gui:
    def add_slider(self, *_: Any, initial_value: float, **__: Any) -> Any:
        return SimpleNamespace(value=initial_value, on_update=lambda _function: None)

    def add_checkbox(self, *_: Any, initial_value: bool) -> Any:
        return SimpleNamespace(value=initial_value)

    def add_html(self, _text: str) -> None: ...

    def add_uplot(self, **_: Any) -> Any:
        return SimpleNamespace()


class Looker:
    """A timeline of 30 s, a moment every 0.1 s, and a clock that goes when told."""

    def __init__(self, snapshot: Any, last_s: float = 30.0) -> None:
        self.now_s, self.snapshot = 0.0, snapshot
        gui: Any = Gui()
        self.timeline = Timeline(gui, 20.0, lambda: self.now_s)
        for k in range(round(last_s * 10) + 1):
            self.keep(k / 10)

    def keep(self, t_s: float) -> None:
        sheet = picture_html(np.full((20, 30, 3), round(t_s * 5) % 256, np.uint8), "grey")
        self.timeline.keep(self.snapshot._replace(t_ns=round(t_s * 1e9)), sheet)

    def check(self, back_s: float) -> float | None:
        self.timeline.back.value = back_s
        self.timeline._check()
        return self.displayed_s()

    def displayed_s(self) -> float | None:
        past = self.timeline.displayed()
        return None if past is None else past.state.t_ns / 1e9


def test_a_chosen_moment_stays_that_one_while_the_run_goes_on(snapshot: Any) -> None:
    looker = Looker(snapshot)
    assert looker.displayed_s() is None
    assert looker.check(5.0) == 25.0
    for k in range(301, 351):
        looker.keep(k / 10)
    assert looker.displayed_s() == 25.0
    past = looker.timeline.displayed()
    assert past is not None
    assert past.sheet is not None
    assert 'alt="grey" width="30" height="20"' in past.sheet
    assert past.state.images is None
    assert looker.check(0.0) is None


def test_no_further_back_than_what_is_kept_and_of_the_muscle_signal_one_a_second(snapshot: Any) -> None:
    looker = Looker(snapshot)
    assert looker.check(60.0) == 10.0
    assert len(looker.timeline._kept) == 201
    assert len({id(past.emg) for past in Looker(snapshot, 3.0).timeline._kept}) == 4
    looker.keep(0.0)  # another run begins
    assert looker.displayed_s() == 0.0


def test_a_loop_plays_from_there_to_the_moment_of_looking_at_true_speed(snapshot: Any) -> None:
    looker = Looker(snapshot)
    looker.check(4.0)
    looker.timeline.loop.value = True
    seen = []
    for k in range(9):
        looker.now_s = 1.0 * k + 0.05
        looker.keep(30.1 + k)  # the run goes on and changes nothing of the loop
        seen.append(looker.displayed_s())
    assert seen == [26.0, 27.0, 28.0, 29.0, 26.0, 27.0, 28.0, 29.0, 26.0]


def test_the_chart_can_be_drawn_up_to_an_earlier_time(snapshot: Any) -> None:
    gui: Any = Gui()
    chart = CourseChart(gui, 20.0)
    for k in range(301):
        chart.note(snapshot._replace(t_ns=k * 10**8))
    chart.draw(20.0)
    assert (chart._plot.data[0].min(), chart._plot.data[0].max()) == (20.0 - COURSE_S, 20.0)
    chart.draw()
    assert chart._plot.data[0].max() == 30.0


@pytest.mark.slow
def test_the_page_shows_the_past_beside_the_state_of_now() -> None:
    moments = Moments()
    with BrowserView("a run", port=0, controls=Controls()) as view:
        timeline = view.page.timeline
        for k in range(4):
            snapshot = moments.at(1.0 + k, emg=False)
            state = "hold" if k == 3 else "active"
            view.offer(snapshot._replace(loop=snapshot.loop._replace(state=state)))
            until(partial(lambda n: len(timeline._kept) == n, k + 1))
        timeline.back.value = 2.0
        timeline._check()
        # Nothing new comes: the page is painted all the same.
        until(lambda: "LOOKING BACK" in view.page._looking.content)
        assert "<b>2.0 s</b>" in view.page._looking.content
        assert ">HOLD<" in view.page.run_state.content
        timeline.back.value = 0.0
        until(lambda: view.page._looking.content == "")
