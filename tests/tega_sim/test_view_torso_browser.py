# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""The torso and the timeline in a real browser: a click asks for that motor. Skipped where there is no Chromium."""

from __future__ import annotations

from functools import partial

import pytest

from reference.chromium import launched, opened
from reference.moments import Moments
from reference.waiting import until
from tega.loop.motor_tests import MotorAnswer
from tega.ui.view.browser import BrowserView, Controls

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def browser():
    with launched() as browser:
        yield browser


def test_a_click_on_a_motor_asks_for_it_and_says_what_came_of_it(browser):
    requested: list[int] = []

    def ask(motor: int) -> MotorAnswer:
        requested.append(motor)
        return MotorAnswer(done=False, words="not tried: the run is active")

    controls = Controls(try_motor=ask, can_go=True)
    moments = Moments()
    with BrowserView("armed", port=0, controls=controls) as view, opened(browser, view.url) as page:
        view.offer(moments.at(2.0))
        page.get_by_label("try motor 22").first.click(timeout=60_000)
        page.get_by_text("not tried: the run is active").first.wait_for(timeout=60_000)
        assert requested == [22]
        page.get_by_role("button", name="Go").click()
        until(lambda: controls.may_go)


def test_the_slider_looks_back(browser):
    moments = Moments()
    with BrowserView("a run", port=0) as view, opened(browser, view.url) as page:
        kept = view.page.timeline._kept
        for k in range(5):
            view.offer(moments.at(1.0 + k))
            until(partial(lambda n: len(kept) == n, k + 1))
        slider = page.get_by_role("slider").first
        slider.focus()
        for _ in range(20):  # a tenth of a second each
            slider.press("ArrowRight")
        page.get_by_text("LOOKING BACK").wait_for(timeout=60_000)
        until(lambda: "<b>3.0 s</b>" in view.page._looking.content)
        slider.press("Home")
        page.get_by_text("LOOKING BACK").wait_for(state="detached", timeout=60_000)
