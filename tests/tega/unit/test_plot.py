"""What is drawn: on axes, as HTML for notebooks, and the page in the terminal in 80 x 24 and in 120 columns."""

from __future__ import annotations

import io
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import matplotlib as mpl
import numpy as np
import pytest
from rich.console import Console

import tega
from reference.moments import Moments
from reference.recordings import baseline, pressed
from reference.scripted import MS, touching
from tega.errors import InvalidValueError, MissingExtraError
from tega.haptics import LAYOUTS, MotorLevels, vest_frame
from tega.haptics.motor_layout import find_layout, torso_svg
from tega.loop.snapshot import LoopView
from tega.records import Contact, Intent, NamedValue, SentFrame, VestFrame
from tega.safety.states import STATES
from tega.ui.cli.page import address_lines
from tega.ui.cli.report import figures_table
from tega.ui.view.run_state import meaning
from tega.ui.view.same_machine import url_host
from tega.ui.view.terminal import _STATE_STYLES, TerminalView, render

HOSTILE = '<script>alert("x")</script>&'


@pytest.fixture(autouse=True)
def _no_window() -> Iterator[None]:
    mpl.use("Agg")
    import matplotlib.pyplot as plt

    yield
    plt.close("all")


def test_a_contact_is_outlined_where_there_is_one() -> None:
    axes = tega.plot.contact(pressed(60.0, noise=1), baseline(), "paper")
    assert len(axes.images) == 1
    assert len(axes.lines) == len(axes.collections) == 1
    assert np.asarray(axes.lines[0].get_xdata())[0] == pytest.approx(40, abs=2)
    assert tega.plot.contact(baseline(), baseline(), "paper").get_title() == "no contact"
    assert axes.get_title().endswith(" grey/px²")
    assert tega.plot.contact(pressed(60.0, noise=1), baseline()).get_title().endswith(" grey/px")


def test_a_course_is_drawn_from_topic_frame_and_array(lossless: Path) -> None:
    topic = tega.open_recording(lossless)["/tactile/thumb/contact"]
    table = topic.to_numpy()
    for data in (topic, table, topic.to_pandas(), topic.columns()):
        axes = tega.plot.course(data, "force_n", "depth_mm")
        for line, name in zip(axes.lines, ("force_n", "depth_mm"), strict=True):
            assert np.array_equal(line.get_xdata(), table["t_s"])
            assert np.array_equal(line.get_ydata(), table[name])
    with pytest.raises(InvalidValueError, match="no column 'weight'"):
        tega.plot.course(topic, "weight")


def test_levels_have_a_line_for_each_muscle_and_the_fused_one(lossless: Path) -> None:
    topic = tega.open_recording(lossless)["/emg/levels"]
    axes = tega.plot.levels(topic)
    assert [line.get_label() for line in axes.lines] == ["ch1", "ch2", "ch3", "fused"]
    assert np.array_equal(axes.lines[-1].get_ydata(), topic.to_numpy()["fused"])


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_motor_is_drawn_where_it_is(layout: str) -> None:
    n = len(find_layout(layout).motors)
    intensities = np.arange(n, dtype=np.uint8)
    frame = MotorLevels(layout, intensities)
    axes = tega.plot.vest(frame)
    offsets = np.asarray(axes.collections[0].get_offsets())
    drawn = ET.fromstring(frame._repr_html_())
    circles = drawn.findall("{http://www.w3.org/2000/svg}circle")
    assert len(circles) == n
    for motor, (x, y), circle in zip(find_layout(layout).motors, offsets, circles, strict=True):
        assert (x > 120) == (motor.face == "back")
        assert (float(circle.get("cx", "")), float(circle.get("cy", ""))) == pytest.approx((x, y), abs=0.06)
    shares = [float(circle.get("fill-opacity", "")) for circle in circles]
    assert shares == pytest.approx(intensities / 100)
    record = VestFrame(t_ns=0, layout=layout, intensities=tuple(range(n)))
    assert record._repr_html_() == frame._repr_html_() == torso_svg(layout, list(range(n)))
    assert tega.plot.vest(record).get_title() == layout


def test_names_are_escaped() -> None:
    displayed = [
        Contact(finger=HOSTILE, t_ns=0, in_contact=True, more=(NamedValue(HOSTILE, 1.0, HOSTILE),)),
        VestFrame(t_ns=0, layout=HOSTILE, intensities=(1,)),
        SentFrame(t_ns=0, layout="x40", intensities=(1,)),
    ]
    for record in displayed:
        html = record._repr_html_()
        assert html is not None
        assert "<script>" not in html
        ET.fromstring(f"<div>{html}</div>")


def test_without_matplotlib_the_error_has_the_pip_line(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] == "matplotlib"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtraError) as reported:
        tega.plot.vest(vest_frame([0] * 4, [0] * 4))
    assert reported.value.hint == "install it with: pip install 'tega[plot]'"


def test_importing_tega_loads_neither_numpy_nor_a_part() -> None:
    code = "import sys, tega; print([n for n in sys.modules if n.startswith(('numpy', 'tega.', 'msgspec'))])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def screen(view: LoopView, width: int = 80, **how: Any) -> str:
    file = io.StringIO()
    given: dict[str, Any] = {"title": "test", "rates_hz": {}, "width": width}
    Console(file=file, width=width, color_system=None).print(render(view, **(given | how)))
    return file.getvalue()


VIEW = LoopView(
    200 * MS,
    {"thumb": touching(50, t_ns=50 * MS), "index": touching(50, t_ns=190 * MS)},
    MotorLevels("x40", np.zeros(40, np.uint8)),
    None,
    None,
    {},
)


def test_a_finger_without_fresh_pictures_shows_no_data() -> None:
    lines = {line.split()[1]: line for line in screen(VIEW).splitlines() if len(line.split()) > 2}
    assert "no data" in lines["thumb"]
    assert "no data" not in lines["index"]
    assert "no sensor" in lines["ring"]
    # Fingers of other names stand in place of the four.
    text = screen(VIEW._replace(fingers=("left_palm", "thumb")))
    assert "left_palm  no sensor" in text
    assert "thumb" in text
    assert "ring" not in text


def test_state_reason_and_alerts_stand_first() -> None:
    assert set(_STATE_STYLES) == set(STATES)
    assert all(isinstance(meaning(VIEW._replace(state=state)), str) for state in STATES)
    held = VIEW._replace(
        state="hold",
        reason="emg: no signal for 0.3 s",
        alerts=("emg: no signal for 0.3 s", "vest: not reached, so touch is not felt"),
        latency="camera to vest 9 ms",
    )
    lines = screen(held).splitlines()
    assert "HOLD" in lines[1]
    assert "emg: no signal" in lines[2]
    assert "! vest: not reached" in lines[3]
    assert "camera to vest 9 ms" in lines[-2]
    going_on = screen(held._replace(state="active", reason="all devices ready"))
    assert "all devices ready" not in going_on
    assert "! emg: no signal" in going_on


def test_a_moment_that_has_grown_old_is_told_to_be_unless_it_is_the_last() -> None:
    active = VIEW._replace(state="active")
    assert "no news" not in screen(active, age_s=1.0)
    assert "no news from the run for 7 s" in screen(active, age_s=7.2).splitlines()[1]
    assert "no news" not in screen(VIEW._replace(state="stopped", reason="asked to"), age_s=7.2)


def test_a_moment_that_cannot_be_drawn_is_told_and_the_next_one_is_drawn() -> None:
    now_s = 0.0
    console = Console(width=90, height=40, force_terminal=True)
    with console.capture() as capture, TerminalView("test", console=console, now_s=lambda: now_s) as show:
        show(VIEW._replace(state="hold", intent=Intent(t_ns=0, level=9)))
        now_s = 1.0
        show(VIEW._replace(state="active"))
    text = capture.get()
    assert "HOLD  not drawn: IndexError" in text
    assert "ACTIVE" in text


FULL = (
    Moments()
    .at(2.0)
    .loop._replace(
        state="active",
        alerts=("vest: not reached, so touch is not felt", "latency: camera to vest p99 12 ms", "x", "y"),
        latency="camera to vest p50 1.1 ms, p99 2.3 ms (n 1200); muscle to hand p50 4.2 ms, p99 9.1 ms (n 410)",
        angles_rad=[0.4] * 16,
        command=5.0,
        devices=frozenset({"emg", "hand", "vest"}),
    )
)
RATES = {"touch": 60.0, "levels": 10.0, "hand": 333.0, "vest": 30.0}


@pytest.mark.parametrize(("width", "height"), [(80, 24), (120, 40), (200, 60)])
def test_hand_levels_rates_latency_and_both_faces_are_in_sight(width: int, height: int) -> None:
    named = {"title": "lab[red].toml", "address": "http://[fd00::2]:8080/t/"}
    drawn = screen(FULL, width, rates_hz=RATES, height=height, **named)
    lines = drawn.splitlines()
    assert len(lines) <= height - 1  # the cursor stands in the line below
    assert {len(line) for line in lines} == {min(width, 120)}
    hand = ("command level 5: tight", "reported bend", "channels", "333 Hz", "n 410")
    assert all(text in drawn for text in (*hand, "front", "back", "vest", *named.values()))
    assert ("! 2 more" in drawn) == (height == 24)  # alerts that do not fit are counted


def test_a_number_in_a_narrow_terminal_is_whole() -> None:
    table = figures_table(["stage"], ["worst, ms"])
    table.add_row("hand-over", "192.98")
    (console := Console(file=io.StringIO(), width=18)).print(table)
    assert re.sub(r"\s", "", console.file.getvalue()).endswith("hand-over192.98")  # type: ignore[attr-defined]


def test_the_page_s_address_has_a_line_of_its_own_and_over_ssh_the_command_that_forwards_its_port() -> None:
    url = "http://127.0.0.1:8080/kJ2nX0bq3mX4T5v6y7z8Aw/"
    assert address_lines(url, {})[-1] == url
    over = address_lines(url, {"SSH_CONNECTION": "10.0.0.2 50000 10.0.0.7 22", "USER": "lab"})
    assert over[1] == url
    assert over[-1] == "ssh -N -L 8080:127.0.0.1:8080 lab@10.0.0.7"
    assert max(map(len, over)) < 80
    served = address_lines("http://10.0.0.7:8080/t/", {"SSH_CONNECTION": "10.0.0.2 50000 10.0.0.7 22"})
    assert len(served) == 2
    assert [url_host(one) for one in ("::1", "10.0.0.7")] == ["[::1]", "10.0.0.7"]
    assert not {url_host("0.0.0.0"), url_host("::")} & {"0.0.0.0", "[::]"}
