"""The view's page in a real browser: what a person sees of a moment. Skipped where there is no Chromium."""

from __future__ import annotations

import io
import time

import numpy as np
import pytest
from PIL import Image
from reference.chromium import chromium, opened
from reference.moments import Moments

from tega.view.browser import BrowserView, Controls

pytestmark = pytest.mark.timeout(180)


@pytest.fixture(scope="module")
def seen():
    """Open the page on a made-up grasp, and return it with the view and its controls."""
    chromium()
    controls = Controls(can_pause=True, can_mute=True, objects=("bottle", "container", "bag"))
    moments = Moments()
    with BrowserView("TEGA made-up grasp", port=0, controls=controls) as view, opened(view.url) as page:
        for k in range(12):
            view.offer(moments.at(2.0 + k / 30))
            time.sleep(0.15)
        page.get_by_text("2.4 s").wait_for(timeout=20_000)
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
        assert page.get_by_text(finger, exact=True).count() == 3  # its column, and on either face of the vest
    for button in ("bottle", "container", "bag", "Pause", "Stop"):
        assert page.get_by_role("button", name=button).count() == 1


def test_pictures_vest_and_charts(seen):
    page, _ = seen
    sizes = page.evaluate("[...document.images].map(image => [image.naturalWidth, image.naturalHeight])")
    assert [498, 326] in sizes
    assert page.get_by_label("vest").locator("circle").count() == 40
    assert page.locator(".uplot canvas").count() == 3
    drawn = "canvas => new Set(canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data).size"
    for chart in page.locator(".uplot canvas").all():
        assert chart.evaluate(drawn) > 20


def test_the_scene_is_drawn(seen):
    page, _ = seen
    shown = picture(page)[:, 430:1030]
    assert share_near(shown, (120, 160, 190), 45) > 0.01  # the bottle, blue
    assert share_near(shown, (70, 70, 75), 45) > 0.005  # the hand, dark
    assert share_near(shown, (180, 60, 50), 45) > 0.0001  # the force, red


def test_buttons_reach_the_program(seen):
    page, controls = seen
    page.get_by_role("button", name="bag").click()
    for _ in range(200):
        if (wanted := controls.take_object()) is not None:
            break
        time.sleep(0.05)
    assert wanted == "bag"
    page.get_by_role("button", name="Pause").click()
    page.get_by_role("button", name="Go on").wait_for(timeout=20_000)
    assert controls.paused
