"""The page in the terminal: what it says of a run's state, in 80 x 24 and in 120 columns."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from reference.moments import Moments
from reference.scripted import MS, touching
from tega.haptics import MotorLevels
from tega.loop.snapshot import LoopView
from tega.records import Intent
from tega.safety.states import STATES
from tega.ui.cli.page import address_lines
from tega.ui.view.run_state import meaning
from tega.ui.view.terminal import _STATE_STYLES, TerminalView, render


def screen(view: LoopView, width: int = 80, **how: Any) -> str:
    """Draw it without colours."""
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
    drawn = screen(FULL, width, rates_hz=RATES, address="http://[::1]:8080/t/", height=height)
    lines = drawn.splitlines()
    assert len(lines) <= height - 1  # the cursor stands in the line below
    assert {len(line) for line in lines} == {min(width, 120)}
    hand = ("command level 5: tight", "reported bend", "channels", "333 Hz", "n 410")
    assert all(text in drawn for text in (*hand, "front", "back", "vest", "/t/"))
    assert ("! 2 more" in drawn) == (height == 24)  # alerts that do not fit are counted


def test_the_page_s_address_has_a_line_of_its_own_and_over_ssh_the_command_that_forwards_its_port() -> None:
    url = "http://127.0.0.1:8080/kJ2nX0bq3mX4T5v6y7z8Aw/"
    assert address_lines(url, {})[-1] == url
    over = address_lines(url, {"SSH_CONNECTION": "10.0.0.2 50000 10.0.0.7 22", "USER": "lab"})
    assert over[1] == url
    assert over[-1] == "ssh -N -L 8080:127.0.0.1:8080 lab@10.0.0.7"
    assert max(map(len, over)) < 80
    served = address_lines("http://10.0.0.7:8080/t/", {"SSH_CONNECTION": "10.0.0.2 50000 10.0.0.7 22"})
    assert len(served) == 2
