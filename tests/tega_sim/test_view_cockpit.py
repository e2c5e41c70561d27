"""The page tells the state as it is, has lights, delays, sides of the wearer, and a name of its own."""

from __future__ import annotations

import urllib.error
import urllib.request
import xml.etree.ElementTree as ET

import click
import pytest
from click.testing import CliRunner
from msgspec.structs import replace

pytest.importorskip("viser", reason="needs the extra view")

from reference.moments import Moments
from reference.processes import until
from tega.haptics import vest_frame
from tega.ui.cli.page import browser_observer, view_options
from tega.ui.view.browser import BrowserView, Controls
from tega.ui.view.browser.charts import BUDGET_MS, Delays
from tega.ui.view.browser.state_html import lights_html, run_state_html
from tega.ui.view.browser.vest import vest_svg


def test_a_paused_run_is_not_called_active_and_haptics_off_is_said() -> None:
    loop = Moments().at(2.0).loop._replace(state="active", reason="all devices ready")
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


def test_the_page_itself_says_that_the_run_is_paused_at_the_next_moment() -> None:
    controls = Controls(can_pause=True, can_mute=True)
    moments = Moments()
    with BrowserView("a run", port=0, controls=controls) as view:
        controls.paused, controls.haptics = True, False
        snapshot = moments.at(2.0)
        loop = snapshot.loop._replace(state="active")
        view.offer(snapshot._replace(loop=loop))
        until(lambda: "PAUSED" in view.page.run_state.content)
        assert "HAPTICS OFF" in view.page.run_state.content
        until(lambda: "thumb" in view.page.lights.content)


def test_a_light_tells_a_silent_finger_from_an_absent_one() -> None:
    snapshot = Moments().at(2.0)
    thumb = snapshot.loop.contacts["thumb"]
    contacts = dict(snapshot.loop.contacts) | {"thumb": replace(thumb, t_ns=thumb.t_ns - 10**9)}
    del contacts["ring"]
    lights = lights_html(snapshot._replace(loop=snapshot.loop._replace(contacts=contacts)))
    assert 'title="thumb: silent"' in lights
    assert 'title="index: well"' in lights
    assert 'title="ring: absent"' in lights


def test_a_phone_is_given_touch_and_vest_beside_the_state() -> None:
    with BrowserView("a run", port=0) as view:
        view.offer(Moments().at(2.0))
        until(lambda: 'src="data:image/jpeg' in view.page._phone.content)
        assert view.page._phone.content.startswith('<div class="tega-phone">')
        assert view.page._phone.content.count("<circle") == 40


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
    assert CliRunner().invoke(show, [], catch_exceptions=False).exit_code == 0
    assert urls[0].startswith("http://0.0.0.0:")
    assert urls[1].startswith("http://127.0.0.1:")
