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
from reference.processes import until
from tega.loop.controls import MotorAnswer
from tega.ui.view.browser import BrowserView, Controls

# Of the state's badge: of a run that steers, and of one that nothing is heard of.
GREEN, GREY = "rgb(42, 131, 57)", "rgb(108, 117, 125)"

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def browser():
    with launched() as browser:
        yield browser


@pytest.fixture(scope="module")
def page(browser):
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
        yield page


def picture(page) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB")).astype(int)


def share_near(pixels: np.ndarray, colour: tuple[int, int, int], within: int = 40) -> float:
    return float((np.abs(pixels - colour).max(axis=2) < within).mean())


def test_heading_text_buttons_pictures_vest_and_charts(page):
    for text in ("TEGA made-up grasp", "haptics on", "level 5: tight", "2.4 s"):
        assert page.get_by_text(text).count() == 1, text
    for finger in ("thumb", "index", "middle", "ring"):
        displayed = page.get_by_text(finger, exact=True).locator("visible=true")
        assert displayed.count() == 3  # its column, and on either face of the vest
    for button in ("bottle", "container", "bag", "Pause", "Stop"):
        assert page.get_by_role("button", name=button).count() == 1
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


def test_the_scene_is_drawn(page):
    # Without a graphics card it may be drawn seconds after the text.
    until(lambda: share_near(picture(page)[:, 430:1030], (120, 160, 190), 45) > 0.01)
    displayed = picture(page)[:, 430:1030]
    assert share_near(displayed, (120, 160, 190), 45) > 0.01  # the bottle, blue
    assert share_near(displayed, (70, 70, 75), 45) > 0.005  # the hand, dark
    assert share_near(displayed, (180, 60, 50), 45) > 0.0001  # the force, red


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


def test_the_end_of_a_run_is_read_on_the_page(browser):
    snapshot, wrong = Moments().at(2.0), "emg: no signal for 0.5 s"
    with BrowserView("TEGA made-up grasp", port=0) as view, opened(browser, view.url) as page:
        view.offer(snapshot._replace(loop=snapshot.loop._replace(state="hold", reason=wrong)))
        page.get_by_text("HOLD", exact=True).wait_for(timeout=60_000)
        page.get_by_text(wrong).wait_for(timeout=60_000)
        view.offer(snapshot._replace(loop=snapshot.loop._replace(state="stopped", reason="stopped: Ctrl-C")))
        view.__exit__(None, None, None)
        page.get_by_text("STOPPED", exact=True).wait_for(timeout=60_000)
        assert page.get_by_text("HOLD", exact=True).count() == 0


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


def test_a_click_on_a_motor_asks_for_it_and_says_what_came_of_it(browser):
    requested: list[int] = []

    def ask(motor: int) -> MotorAnswer:
        requested.append(motor)
        return MotorAnswer(done=False, words="not tried: the run is active")

    controls = Controls(try_motor=ask, can_go=True)
    steered = Moments().at(2.0)
    with BrowserView("armed", port=0, controls=controls) as view, opened(browser, view.url) as page:
        view.offer(steered)
        page.get_by_label("try motor 22").first.click(timeout=60_000)
        page.get_by_text("not tried: the run is active").first.wait_for(timeout=60_000)
        assert requested == [22]
        go = page.get_by_role("button", name="Go", exact=True)
        assert go.is_disabled()
        view.offer(steered._replace(loop=steered.loop._replace(state="armed")))
        go.click(timeout=60_000)
        until(lambda: controls.may_go)
        until(go.is_disabled)
