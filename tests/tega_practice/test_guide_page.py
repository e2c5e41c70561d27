"""Prompts, bars and buttons of a practice or a test on a page, looked at in a real browser; and bars with two ends."""

from __future__ import annotations

import re
from concurrent.futures import ThreadPoolExecutor

import pytest

from reference.chromium import launched, opened
from tega.runtime.guide import Bar, Undecided
from tega.ui.cli.guide import LineGuide
from tega.ui.cli.guide_page import PageGuide
from tega_practice.live import Target, _bars


@pytest.mark.slow
def test_a_page_asks_shows_bars_and_tells(capsys: pytest.CaptureFixture[str]) -> None:
    with (
        launched() as browser,
        ThreadPoolExecutor(1) as person,
        PageGuide("TEGA Fitts test of p01", yes=False, get_ready_s=0.0) as guide,
        opened(browser, guide.url) as page,
    ):
        guide.part("Fitts test", "fast <and> exactly")
        waits = person.submit(guide.ready, "Arm as in use")
        page.get_by_text("Arm as in use").wait_for()
        assert not waits.done()
        page.get_by_role("button", name="Ready").click()
        waits.result(10)
        guide.show("Go", _bars(Target(0.5, 0.2), 0.25), 7.4)
        page.get_by_text("7 s left").wait_for()
        for text in ("Fitts test", "fast <and> exactly", "Go", "3.0 ± 0.40 level", "2.00"):
            assert page.get_by_text(text, exact=text == "Go").first.is_visible(), text
        assert page.get_by_role("button", name="Ready").count() == 0
        track, filled = "div[style*='background:#e9ecef']", "xpath=./div"
        target, cursor = page.locator(track).nth(0), page.locator(track).nth(1)
        low, high = (target.bounding_box(), target.locator(filled).bounding_box())
        # Levels 2.6 to 3.4 of five.
        assert (high["x"] - low["x"]) / low["width"] == pytest.approx(2.6 / 5, abs=0.01)
        assert high["width"] / low["width"] == pytest.approx(0.8 / 5, abs=0.01)
        box = cursor.locator(filled).bounding_box()
        assert box["width"] / low["width"] == pytest.approx(2.0 / 5, abs=0.01)
        requested = person.submit(guide.ask, "Again?", {"y": "yes", "n": "no"})
        page.get_by_role("button", name="no", exact=True).click()
        assert requested.result(10) == "n"
        guide.say("0.42 bits/s", tone="good")
        page.get_by_text("0.42 bits/s").wait_for()
    assert "0.42 bits/s" in capsys.readouterr().err


@pytest.mark.slow
def test_nobody_is_waited_for_where_nobody_is_there() -> None:
    with PageGuide("TEGA", yes=True, get_ready_s=0.01) as guide:
        guide.ready("Arm as in use")
        with pytest.raises(Undecided):
            guide.ask("Again?", {"y": "yes"})


def test_a_bar_with_two_ends_is_drawn_between_them(capsys: pytest.CaptureFixture[str]) -> None:
    LineGuide(yes=True, get_ready_s=0.0).show("Go", _bars(Target(0.5, 0.2), 0.25), None)
    bars = re.findall("[·█]{8}", capsys.readouterr().err)
    assert bars == ["····█···", "███·····"]
    # However narrow it is, there is something to hit.
    LineGuide(yes=True, get_ready_s=0.0).show("Go", [Bar("target", 0.51, "", low=0.5)], None)
    assert "···█····" in capsys.readouterr().err
