"""How long each guard takes by the emulated devices' own stamps, ten times the hazard table's time at most.

The one place where a test holds a true time. The fault's time is taken before it is asked for, that of its end is the
device's own (the machine's monotonic clock), so that neither makes a guard look faster than it is. A hold of 0 ms lets
the hand open at once, so that the device shows what the run decided.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest

from hazards.bench import TIGHT, Lab, closed, column, lab
from hazards.test_lost import JOYSTICK, on_foot
from hazards.test_stop import start
from reference.processes import begun_by, hand_guards, until
from tega.devices.hand.allegro import Allegro
from tega.devices.hand.allegro_options import AllegroOptions
from tega.devices.vest.player_versions import PlayerOptions
from tega.devices.vest.vest_player import PlayerVest
from tega.haptics import vest_frame
from tega_emulators.process import Emulator
from tega_emulators.stations import Program, free_port, split, write_trees
from tega_emulators.vest_bench import seen_by

pytestmark = pytest.mark.slow

TIMES: Final = 10
# Until a finger that is told to open has gone as far as `opening` asks for, and a look of the run.
ON_THE_WAY_S: Final = 0.2
OPENS: Final = {"hold_ms": 0.0}


def opening(check: dict[str, Any]) -> bool:
    """Whether the emulated fingers have left the tight pose."""
    return bool(np.abs(np.array(check["angles_rad"]) - TIGHT).max() > 0.3)


def let_go(check: dict[str, Any]) -> bool:
    """Whether no motor of the emulated hand pushes."""
    return not check["servo_on"] and not any(check["duties"])


def stamped(hand: Emulator, subject: Callable[[dict[str, Any]], bool]) -> float:
    """Wait until the emulated hand is so; return its stamp, seconds."""
    found: list[float] = []

    def seen() -> bool:
        check = hand.say("look")
        if subject(check):
            found.append(check["t_s"])
        return bool(found)

    until(seen)
    return found[0]


def steered(made: Lab, fault: Callable[[], object], *, before: Callable[[], object] = int) -> float:
    """Let a run close the hand, and make a fault; return after how long the hand opens, seconds."""
    with made.session():
        before()
        made.until(lambda: made.state == "active" and closed(made))
        began_s = time.monotonic()
        fault()
        return stamped(made.hand, opening) - began_s


def test_a_vest_that_is_told_nothing_rests() -> None:
    with (
        Emulator("bhaptics_player", "--port", "0") as player,
        PlayerVest(PlayerOptions(**player.address)) as vest,
    ):
        until(lambda: vest.reached)
        began_s = time.monotonic()
        vest.write(0, vest_frame([80, 60, 40, 20], [13, 0, 100, 53], layout="x40"))
        until(lambda: any(any(motors) for _, motors in seen_by(player).history))
        until(lambda: not any(seen_by(player).motors))
        rested_s = seen_by(player).history[-1][0]
    assert rested_s - began_s < TIMES * 0.2


def test_a_stale_finger_is_silent(tmp_path: Path) -> None:
    with lab(tmp_path, vest=True, fingers=("thumb",)) as made, made.session():
        made.until(lambda: made.state == "active" and column(made, 0))
        began_s = time.monotonic()
        made.sensors["thumb"].say("pause")
        made.until(lambda: not column(made, 0))
        assert seen_by(made.vest).history[-1][0] - began_s < TIMES * (0.1 + 1 / 30)


def test_emg_that_is_lost_holds(tmp_path: Path) -> None:
    with lab(tmp_path, emg=True, hand=True, safety=OPENS | {"emg_lost_ms": 150.0}) as made:
        assert steered(made, lambda: made.emg.say("freeze 1")) < TIMES * 0.26 + ON_THE_WAY_S


def test_electrodes_that_are_off_hold(tmp_path: Path) -> None:
    with lab(tmp_path, emg=True, hand=True, safety=OPENS) as made:
        assert steered(made, lambda: made.emg.say("signal rail")) < TIMES * (0.2 + 0.1) + ON_THE_WAY_S


@pytest.mark.skipif(sys.platform != "linux", reason="the emulated pedal needs Linux")
@pytest.mark.parametrize(("how", "within_s"), [("lift 0", 0.01), ("freeze", 0.11)])
def test_a_dead_man_holds(tmp_path: Path, how: str, within_s: float) -> None:
    with on_foot(tmp_path, JOYSTICK, OPENS) as (made, foot):

        def press() -> None:
            made.until(lambda: "dead-man: released" in made.said())
            foot.say("press 0")

        assert steered(made, lambda: foot.say(how), before=press) < TIMES * (within_s + ON_THE_WAY_S)


@pytest.mark.parametrize(
    ("fault", "within_s"),
    [("half", 0.03), ("slow", 1.0)],
    ids=["no set of positions for 30 ms", "fewer than 250 a second"],
)
@pytest.mark.asked_again("at 30 ms a machine that is busy may be taken for a silent hand before the fault")
def test_a_hand_with_the_shipped_limits_is_let_go(fault: str, within_s: float) -> None:
    make: Any = AllegroOptions
    with Emulator("allegro_port") as hand, Allegro(make(**hand.address, reconnects=0)) as driver:
        driver.step(5)
        until(lambda: any(hand.say("look")["duties"]))
        began_s = time.monotonic()
        hand.say(fault)
        assert stamped(hand, let_go) - began_s < TIMES * within_s


@pytest.mark.parametrize(
    ("how", "within_s"), [(signal.SIGKILL, 0.1), (signal.SIGSTOP, 1.0)], ids=["killed", "stuck"]
)
@pytest.mark.parametrize("whose", ["run", "hand"])
def test_a_killed_or_stuck_run_or_process_of_the_hand_is_let_go_of(
    tmp_path: Path, whose: str, how: signal.Signals, within_s: float
) -> None:
    with lab(tmp_path, emg=True, hand=True, vest=True, fingers=("thumb",)) as made:
        pid = start(made).pid
        if whose == "hand":
            (pid,) = begun_by(pid, "tega.devices.hand.hand_program")
        began_s = time.monotonic()
        os.kill(pid, how)
        assert stamped(made.hand, let_go) - began_s < TIMES * within_s
        if whose == "run":
            made.until(made.at_rest)
            assert seen_by(made.vest).history[-1][0] - began_s < TIMES * 0.2
        with suppress(ProcessLookupError):  # a stopped one ends no other way, should the run end first
            os.kill(pid, signal.SIGKILL)


@pytest.mark.parametrize(("how", "within_s"), [(signal.SIGKILL, 0.1), (signal.SIGSTOP, 2.0)])
def test_a_run_that_has_lost_its_guard_holds(tmp_path: Path, how: signal.Signals, within_s: float) -> None:
    def fault() -> None:
        for pid in hand_guards():
            os.kill(pid, how)

    with lab(tmp_path, emg=True, hand=True, safety=OPENS) as made:
        assert steered(made, fault) < TIMES * (within_s + ON_THE_WAY_S)


def test_a_station_without_an_operator_holds(tmp_path: Path) -> None:
    with lab(tmp_path, emg=True, hand=True, safety=OPENS) as made:
        address = f"tcp/127.0.0.1:{free_port()}"
        robot_tree, operator_tree = split(made.tree, listen=address, connect=address)
        robot_tree["safety"] = made.tree["safety"]
        files = write_trees(tmp_path, (robot_tree, operator_tree))
        with Program("robot", files[0]) as robot:
            robot.await_said("waits for an operator")
            with Program("operator", files[1]) as operator:
                made.until(lambda: closed(made))
                began_s = time.monotonic()
                operator.process.send_signal(signal.SIGSTOP)
                took_s = stamped(made.hand, opening) - began_s
                operator.process.send_signal(signal.SIGCONT)
    assert took_s < TIMES * (0.1 + ON_THE_WAY_S)
