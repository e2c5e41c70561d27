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


def steers(made: Lab) -> bool:
    """Whether the muscles have closed the hand."""
    return made.state == "active" and closed(made)


def opened(made: Lab) -> bool:
    """Whether they really are in the open one."""
    return bool(np.abs(np.array(made.hand.say("look")["angles_rad"]) - OPEN).max() < 0.15)


def test_emg_unplugged_holds_the_level_then_opens_the_hand(tmp_path: Path) -> None:
    with lab(tmp_path, emg=True, hand=True, safety={"hold_ms": 1500.0}) as made:

        def script() -> None:
            made.until(lambda: steers(made))
            made.emg.say("unplug")
            made.until(lambda: made.state == "hold")
            assert "emg: " in made.changes[-1].reason
            assert closed(made)
            made.until(lambda: made.state == "idle")
            assert "held for 1.5 s" in made.changes[-1].reason
            made.until(lambda: opened(made))

        made.run(script)
        assert made.limp()
    assert states(made) == ["armed", "active", "hold", "idle", "stopped"]
    held_s = (made.changes[3].t_ns - made.changes[2].t_ns) / 1e9
    assert held_s >= 1.5
    assert any("then the hand opens" in note for note in made.summary["notes"])


def test_emg_lost_keeps_the_level_where_the_settings_say_so(tmp_path: Path) -> None:
    with lab(tmp_path, emg=True, hand=True, safety={"hold_ms": 100.0, "then": "keep"}) as made:

        def script() -> None:
            made.until(lambda: steers(made))
            made.emg.say("freeze 1")
            made.until(lambda: made.state == "hold")
            time.sleep(1.0)
            assert made.state == "hold"
            assert closed(made)

        made.run(script)
        assert made.limp()


@pytest.mark.raises("emg")
def test_emg_that_comes_back_steers_again(tmp_path: Path) -> None:
    with lab(tmp_path, emg=True, hand=True, safety={"hold_ms": 500.0}) as made:

        def script() -> None:
            made.until(lambda: steers(made))
            # Longer than the driver waits: the board is opened anew.
            made.emg.say("freeze 1")
            made.until(lambda: made.state == "idle")
            made.until(lambda: "no valid sample" in made.said())
            made.emg.say("freeze 0")
            made.until(lambda: made.state == "active")
            made.until(lambda: closed(made))

        made.run(script)
        assert made.limp()
    assert states(made) == ["armed", "active", "hold", "idle", "armed", "active", "stopped"]
    assert any("lost 1 times and found again" in note for note in made.summary["notes"])


@pytest.mark.parametrize(
    ("signal", "words"), [("rail", "stays at"), ("hum", "mostly 50 Hz mains"), ("flat", "stays at 0")]
)
@pytest.mark.raises("votes")
def test_electrodes_that_are_off_hold_the_level_then_open_the_hand(
    tmp_path: Path, signal: str, words: str
) -> None:
    lowest: list[int] = []

    def note(view: LoopView) -> None:
        if view.state in {"active", "hold"} and view.intent is not None:
            lowest.append(view.intent.level)

    with lab(tmp_path, emg=True, hand=True, safety={"hold_ms": 1500.0}) as made:

        def script() -> None:
            made.until(lambda: steers(made))
            lowest.clear()
            made.emg.say(f"signal {signal}")
            made.until(lambda: made.state == "hold")
            reason = made.changes[-1].reason
            assert "emg: no channel can be believed: ch1: " in reason
            assert words in reason
            assert closed(made)
            made.until(lambda: "no vote for ch1" in made.said())
            made.until(lambda: made.state == "idle")
            # All the while the run asked for nothing else than before.
            assert set(lowest) == {5}
            made.until(lambda: opened(made))
            made.emg.say("signal emg")
            made.until(lambda: steers(made))

        made.run(script, observe=note)
        assert made.limp()
    assert states(made) == ["armed", "active", "hold", "idle", "armed", "active", "stopped"]


def test_one_electrode_that_is_off_has_no_vote_and_the_others_go_on(tmp_path: Path) -> None:
    with lab(tmp_path, emg=True, hand=True) as made:

        def script() -> None:
            made.until(lambda: steers(made))
            made.emg.say("signal rail 2")
            made.until(lambda: "no vote for ch2: stays at" in made.said())
            assert made.views[0].intent is not None
            made.until(lambda: made.views[0].intent.channels[1] == 0)  # type: ignore[union-attr]
            time.sleep(0.5)
            assert made.state == "active"
            assert closed(made)

        made.run(script)
        assert made.limp()


def test_a_slow_board_is_refused(tmp_path: Path) -> None:
    with lab(tmp_path, emg=True) as made:
        made.emg.say("slow 0.7")
        with pytest.raises(SampleRateError):
            made.run(lambda: None)
