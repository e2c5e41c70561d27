"""Muscle signals are lost while a person is steering: these lines of the hazard table, on an emulated board."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from hazards.bench import OPEN, Lab, closed, lab, states
from tega.errors import SampleRateError
from tega.loop.snapshot import LoopView

pytestmark = pytest.mark.slow

ALERT_OF_EMG, ALERT_OF_VOTES = pytest.mark.raises("emg"), pytest.mark.raises("votes")
SILENT = ("no valid sample", "freeze 0", "lost 1 times and found again")
OFF = ("emg: no channel can be believed: ch1: ", "no vote for ch1", "signal emg", "")


def steers(made: Lab) -> bool:
    """Whether the muscles have closed the hand."""
    return made.state == "active" and closed(made)


@pytest.mark.parametrize(
    ("fault", "why", "reason", "alert", "back", "noted"),
    [
        pytest.param("unplug", "", "emg: ", "", "", "then the hand opens", id="unplugged"),
        # Longer than the driver waits: the board is opened anew.
        pytest.param("freeze 1", "", "emg: ", *SILENT, marks=ALERT_OF_EMG, id="silent"),
        pytest.param("signal rail", "stays at", *OFF, marks=ALERT_OF_VOTES, id="at the limit"),
        pytest.param("signal hum", "mostly 50 Hz mains", *OFF, marks=ALERT_OF_VOTES, id="mains"),
        pytest.param("signal flat", "stays at 0", *OFF, marks=ALERT_OF_VOTES, id="flat"),
    ],
)
def test_lost_muscles_hold_the_level_then_open_the_hand_and_steer_again(
    tmp_path: Path, fault: str, why: str, reason: str, alert: str, back: str, noted: str
) -> None:
    levels: list[int] = []

    def note(view: LoopView) -> None:
        if view.state in {"active", "hold"} and view.intent is not None:
            levels.append(view.intent.level)

    def opened() -> bool:
        return bool(np.abs(np.array(made.hand.say("look")["angles_rad"]) - OPEN).max() < 0.15)

    with lab(tmp_path, emg=True, hand=True, safety={"hold_ms": 1500.0}) as made:
        with made.session(observe=note):
            made.until(lambda: steers(made))
            levels.clear()
            made.emg.say(fault)
            made.until(lambda: made.state == "hold")
            assert reason in made.changes[-1].reason
            assert why in made.changes[-1].reason
            assert closed(made)
            made.until(lambda: made.state == "idle")
            assert "held for 1.5 s" in made.changes[-1].reason
            made.until(lambda: alert in made.said())
            # All the while the run asked for nothing else than before.
            assert set(levels) == {5}
            made.until(opened)
            if back:
                made.emg.say(back)
                made.until(lambda: steers(made))
        assert made.limp()
    again = ["armed", "active"] if back else []
    assert states(made) == ["armed", "active", "hold", "idle", *again, "stopped"]
    assert made.changes[3].t_ns - made.changes[2].t_ns >= 1.5e9
    assert noted in " ".join(made.summary["notes"])


def test_emg_lost_keeps_the_level_where_the_settings_say_so(tmp_path: Path) -> None:
    with lab(tmp_path, emg=True, hand=True, safety={"hold_ms": 100.0, "then": "keep"}) as made:
        with made.session():
            made.until(lambda: steers(made))
            made.emg.say("freeze 1")
            made.until(lambda: made.state == "hold")
            time.sleep(1.0)
            assert made.state == "hold"
            assert closed(made)
        assert made.limp()


def test_one_electrode_that_is_off_has_no_vote_and_the_others_go_on(tmp_path: Path) -> None:
    with lab(tmp_path, emg=True, hand=True) as made:
        with made.session():
            made.until(lambda: steers(made))
            made.emg.say("signal rail 2")
            made.until(lambda: "no vote for ch2: stays at" in made.said())
            assert made.views[0].intent is not None
            made.until(lambda: made.views[0].intent.channels[1] == 0)  # type: ignore[union-attr]
            time.sleep(0.5)
            assert made.state == "active"
            assert closed(made)
        assert made.limp()


def test_a_slow_board_is_refused(tmp_path: Path) -> None:
    with lab(tmp_path, emg=True) as made:
        made.emg.say("slow 0.7")
        with pytest.raises(SampleRateError), made.session():
            pass
