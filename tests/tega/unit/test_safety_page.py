"""What the page in the terminal says of a run's state."""

from __future__ import annotations

import io

import numpy as np
from rich.console import Console

from reference.scripted import MS, touching
from tega.haptics import MotorLevels
from tega.loop.snapshot import LoopView
from tega.records import Intent
from tega.safety.states import STATES
from tega.ui.view.run_state import meaning
from tega.ui.view.terminal import _STATE_STYLES, TerminalView, render


def screen(view: LoopView, *, age_s: float = 0.0) -> str:
    """Draw it on 80 columns without colours."""
    console = Console(file=io.StringIO(), width=80, color_system=None)
    console.print(render(view, title="test", rates_hz={}, age_s=age_s))
    file = console.file
    assert isinstance(file, io.StringIO)
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
