# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""The view's page in a real browser: what a person sees of a moment. Skipped where there is no Chromium."""

from __future__ import annotations

import io
import itertools
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from reference.chromium import launched, opened
from reference.moments import Moments
from reference.waiting import until
from tega.ui.view.browser import BrowserView, Controls
from tega.ui.view.state import ViewState
from tega_figures.chromium import HEIGHT_PX, WIDTH_PX

# As the page's light shows them.
OBJECT_COLOURS = {"bottle": (120, 160, 180), "bag": (190, 165, 130)}

# Of the state's badge: of a run that steers, and of one that nothing is heard of.
GREEN, GREY = "rgb(43, 138, 62)", "rgb(134, 142, 150)"

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def browser():
    with launched() as browser:
        yield browser


@pytest.fixture(scope="module")
def seen(browser):
    """Open the page on a made-up grasp, and return it with its controls."""
    controls = Controls(can_pause=True, can_mute=True, objects=("bottle", "container", "bag"))
    moments = Moments()
    with (
        BrowserView("TEGA made-up grasp", port=0, controls=controls) as view,
        opened(browser, view.url) as page,
    ):
        for k in range(12):
            view.offer(moments.at(2.0 + k / 30))
            time.sleep(0.15)
        page.get_by_text("2.4 s").wait_for(timeout=60_000)
        yield page, controls


def picture(page) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB")).astype(int)


def share_near(pixels: np.ndarray, colour: tuple[int, int, int], within: int = 40) -> float:
    return float((np.abs(pixels - colour).max(axis=2) < within).mean())


def test_heading_text_and_buttons(seen):
    page, _ = seen
    for text in ("TEGA made-up grasp", "haptics on", "level 5: tight", "2.4 s"):
        assert page.get_by_text(text).count() == 1, text
    for finger in ("thumb", "index", "middle", "ring"):
        displayed = page.get_by_text(finger, exact=True).locator("visible=true")
        assert displayed.count() == 3  # its column, and on either face of the vest
    for button in ("bottle", "container", "bag", "Pause", "Stop"):
        assert page.get_by_role("button", name=button).count() == 1


def test_pictures_vest_and_charts(seen):
    page, _ = seen
    sizes = page.evaluate("[...document.images].map(image => [image.naturalWidth, image.naturalHeight])")
    assert [498, 326] in sizes
    # What the page looks back at has a vest of its own, which is hidden until somebody does.
    assert page.get_by_label("vest").locator("circle").locator("visible=true").count() == 40
    assert page.locator(".uplot canvas").count() == 3
    drawn = (
        "canvas => new Set(canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data).size"
    )
    for chart in page.locator(".uplot canvas").all():
        assert chart.evaluate(drawn) > 20


def brightest_of_a_touch_map(page) -> int:
    """Return the brightest value in the index finger's map on the sheet that the page shows; -1 for no sheet."""
    brightest: int = page.evaluate(
        """() => {
            const image = [...document.images].find(one => one.offsetParent && one.naturalWidth == 498);
            if (!image) return -1;
            const drawing = Object.assign(document.createElement("canvas"), {width: 100, height: 140}).getContext("2d");
            drawing.drawImage(image, -136, -176);
            const red = drawing.getImageData(0, 0, 100, 140).data.filter((_, k) => k % 4 == 0);
            return red.reduce((a, b) => Math.max(a, b), 0);
        }"""
    )
    return brightest


def test_touch_maps_are_seen_by_a_slow_browser_while_more_of_them_come(browser):
    """Without a graphics card the browser is given the next sheet before it has had time to load the last."""
    moments = Moments()
    untouched, pressed = moments.at(0.0), [moments.at(3.0 + k / 30) for k in range(2)]
    over = threading.Event()

    def go_on(view: BrowserView) -> None:
        for n in itertools.count(1):
            t_ns = round(1e9 * n / 30)
            state = pressed[n % 2]
            view.offer(state._replace(t_ns=t_ns, loop=state.loop._replace(t_ns=t_ns)))
            if over.wait(1 / 30):
                return

    with BrowserView("TEGA made-up grasp", port=0) as view, opened(browser, view.url) as page:
        view.offer(untouched)
        until(lambda: 0 <= brightest_of_a_touch_map(page) < 80)
        going = threading.Thread(target=go_on, args=(view,))
        going.start()
        try:
            until(lambda: brightest_of_a_touch_map(page) > 200)
        finally:
            over.set()
            going.join()


def test_the_scene_is_drawn(seen):
    page, _ = seen
    # Without a graphics card it may be drawn seconds after the text.
    until(lambda: share_near(picture(page)[:, 430:1030], (120, 160, 190), 45) > 0.01)
    displayed = picture(page)[:, 430:1030]
    assert share_near(displayed, (120, 160, 190), 45) > 0.01  # the bottle, blue
    assert share_near(displayed, (70, 70, 75), 45) > 0.005  # the hand, dark
    assert share_near(displayed, (180, 60, 50), 45) > 0.0001  # the force, red


def test_buttons_reach_the_program(seen):
    page, controls = seen
    page.get_by_role("button", name="bag").click()
    until(lambda: controls.take_object() == "bag")
    page.get_by_role("button", name="Pause").click()
    page.get_by_role("button", name="Go on").wait_for(timeout=60_000)
    assert controls.paused


def within(inner: dict[str, float], outer: dict[str, float]) -> bool:
    """Whether a box lies in another; a pixel is what rounding takes."""
    return all(
        inner[edge] >= outer[edge] - 1 and inner[edge] + inner[length] <= outer[edge] + outer[length] + 1
        for edge, length in (("x", "width"), ("y", "height"))
    )


def test_every_chart_lies_whole_in_its_panel(seen):
    page, _ = seen
    for side, n_charts in (("left", 1), ("right", 2)):
        panel = page.locator(f"[data-dock-region={side}]")
        charts = panel.locator(".uplot").all()
        assert len(charts) == n_charts
        for chart in charts:
            assert within(chart.bounding_box(), panel.bounding_box())


def test_in_a_narrow_window_the_panels_stand_below_the_scene(seen):
    page, _ = seen
    scene = page.locator("canvas").first
    page.set_viewport_size({"width": 820, "height": 1180})
    try:
        until(lambda: scene.bounding_box()["width"] > 800)
        displayed = scene.bounding_box()
        assert displayed["height"] > 500
        for side in ("left", "right"):
            panel = page.locator(f"[data-dock-region={side}]").bounding_box()
            assert panel["y"] >= displayed["y"] + displayed["height"] - 1
            assert panel["width"] > 400
            chart = page.locator(f"[data-dock-region={side}] .uplot").first.bounding_box()
            assert panel["x"] <= chart["x"]
            assert chart["x"] + chart["width"] <= panel["x"] + panel["width"]
    finally:
        page.set_viewport_size({"width": WIDTH_PX, "height": HEIGHT_PX})
        until(lambda: scene.bounding_box()["width"] < 700)
    assert scene.bounding_box()["width"] > 600


def test_on_a_phone_the_sheet_is_as_wide_as_the_screen(browser):
    with (
        BrowserView("TEGA made-up grasp", port=0, controls=Controls()) as view,
        opened(browser, view.url, width_px=390, height_px=844) as page,
    ):
        view.offer(Moments().at(2.0))
        page.get_by_text("2.0 s", exact=True).wait_for(state="attached", timeout=60_000)
        sheet = page.locator(".tega-phone")
        until(lambda: sheet.bounding_box()["width"] > 360)
        assert sheet.bounding_box()["x"] < 20
        scene, lights = page.locator("canvas").first, page.locator(".tega-lights")
        below = page.locator(".mantine-Paper-root:has(.tega-phone)").bounding_box()
        # The sheet covers nothing of the scene, and no line another one.
        assert scene.bounding_box()["height"] + below["height"] == pytest.approx(844, abs=2)
        assert scene.bounding_box()["height"] > 300
        thumb = sheet.get_by_text("thumb", exact=True).first.bounding_box()
        assert thumb["y"] >= lights.bounding_box()["y"] + lights.bounding_box()["height"]
        # Stop is in sight, however far the sheet is scrolled.
        stop = page.get_by_role("button", name="Stop")
        for _ in range(3):
            place = stop.bounding_box()
            assert 0 <= place["y"] <= 844 - place["height"]
            page.mouse.move(195, 650)
            page.mouse.wheel(0, 2000)
            time.sleep(0.1)


def test_a_hold_and_the_end_of_a_run_are_read_on_the_page(browser):
    snapshot = Moments().at(2.0)

    def in_state(state: str, reason: str) -> ViewState:
        return snapshot._replace(loop=snapshot.loop._replace(state=state, reason=reason))

    with BrowserView("TEGA made-up grasp", port=0) as view, opened(browser, view.url) as page:
        view.offer(in_state("active", "all devices ready"))
        page.get_by_text("ACTIVE", exact=True).wait_for(timeout=60_000)
        assert page.get_by_text("all devices ready").count() == 0
        view.offer(in_state("hold", "emg: no signal for 0.5 s"))
        page.get_by_text("HOLD", exact=True).wait_for(timeout=60_000)
        page.get_by_text("emg: no signal for 0.5 s").wait_for(timeout=60_000)
        view.offer(in_state("stopped", "stopped: Ctrl-C"))
        view.__exit__(None, None, None)
        page.get_by_text("STOPPED", exact=True).wait_for(timeout=60_000)
        assert page.get_by_text("ACTIVE", exact=True).count() == 0


def test_a_program_that_is_stopped_leaves_no_page_that_says_active(browser):
    """The browser says it alone: a stopped process holds its connection open and sends nothing."""
    serve = (
        "import sys, time\n"
        "from reference.moments import Moments\n"
        "from tega.ui.view.browser import BrowserView\n"
        "moment = Moments().at(2.0, images=False, scene=False, emg=False)\n"
        "moment = moment._replace(loop=moment.loop._replace(state='active'))\n"
        "with BrowserView('TEGA', port=0) as view:\n"
        "    print(view.url, flush=True)\n"
        "    while True:\n"
        "        view.offer(moment)\n"
        "        time.sleep(0.4)\n"
    )
    tests = Path(__file__).parents[1]
    program = subprocess.Popen(
        [sys.executable, "-c", serve],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tests), os.environ["PYTHONPATH"]])},
    )
    try:
        assert program.stdout is not None
        with opened(browser, program.stdout.readline().strip()) as page:
            late = page.get_by_text("no news from the run for")
            page.get_by_text("ACTIVE", exact=True).wait_for(timeout=60_000)
            until(lambda: badge_colour(page) == GREEN and not late.is_visible())
            program.send_signal(signal.SIGSTOP)
            late.wait_for(state="visible", timeout=60_000)
            until(lambda: badge_colour(page) == GREY)
            program.send_signal(signal.SIGCONT)
            until(lambda: badge_colour(page) == GREEN and not late.is_visible())
            program.kill()
            late.wait_for(state="visible", timeout=60_000)
    finally:
        program.kill()
        program.communicate()


def badge_colour(page) -> str:
    badge = page.get_by_text("ACTIVE", exact=True)
    colour: str = badge.evaluate("badge => getComputedStyle(badge).backgroundColor")
    return colour


@pytest.mark.parametrize("name", ["bottle", "bag"])
def test_the_bench_with_an_object_held_up(name, browser):
    """Show a simulated lift at its height."""
    pytest.importorskip("mujoco", reason="the simulated world needs the extra sim")
    from tega_sim.trial import TrialPlan, run_trial

    course: list[ViewState] = []
    run_trial(TrialPlan(object=name, condition="haptic", seed=1), observer=course.append)
    held = [k for k, s in enumerate(course) if (s.rows["phase"], s.rows["lifted"]) == ("hold", "yes")]
    assert held, f"the {name} was not lifted"
    last = held[min(10, len(held) - 1)]
    snapshot = course[last]
    controls = Controls(can_pause=True, can_mute=True, objects=("bottle", "container", "bag"))
    with (
        BrowserView("TEGA demo, simulated", port=0, controls=controls) as view,
        opened(browser, view.url) as page,
    ):
        offered_s = time.monotonic()
        for k in range(last % 3, last + 1, 3):
            view.offer(course[k])
            until(lambda: view.n_painted + view.n_dropped == view.n_offered)
            if last - k < 75:  # at its own pace in the end, so that the rates shown are true
                time.sleep(max(0.0, 0.1 - (time.monotonic() - offered_s)))
            offered_s = time.monotonic()
        page.get_by_text(f"{snapshot.t_ns / 1e9:.1f} s", exact=True).wait_for(timeout=60_000)
        until(lambda: share_near(picture(page)[:420, 430:1030], OBJECT_COLOURS[name]) > 0.01)
        page.wait_for_timeout(3_000)
        displayed = picture(page)
    over_table = displayed[:420, 430:1030]
    assert share_near(over_table, OBJECT_COLOURS[name]) > 0.01
    touch_maps = displayed[260:395, 10:415]
    touching = [finger for finger, contact in snapshot.loop.contacts.items() if contact.in_contact]
    assert (share_near(touch_maps, (39, 208, 69), 70) > 0.0003) == bool(touching)  # green circles
