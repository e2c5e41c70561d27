"""Something is lost while a person is steering: each line of the hazard table, on emulated devices."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import pytest

from hazards.bench import LONGEST_S, Lab, closed, column, lab, states
from hazards.test_stop import whole
from reference.hand_bench import pushes
from reference.processes import hand_guards, until
from tega.devices.hand.allegro import Allegro
from tega.devices.hand.allegro_options import AllegroOptions
from tega.errors import CalibrationError, DeviceUnavailableError
from tega.hand import TORQUE_LIMITS
from tega.recording.inspection import inspect_file
from tega_emulators.hid_port import HidBoard, HidPort
from tega_emulators.process import Emulator
from tega_emulators.vest_bench import seen_by

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("fault", "why"),
    [
        ("pause", ""),
        ("freeze", "the same again and again"),
        ("black", "those that come are black"),
        ("torn", "those that come are torn"),
        ("wear half-lit", "of the light of the untouched picture"),
        ("cut", ""),
    ],
)
@pytest.mark.raises("thumb")
def test_a_lost_camera_silences_its_column_and_no_other(tmp_path: Path, fault: str, why: str) -> None:
    with lab(tmp_path, vest=True, fingers=("thumb", "index")) as made:
        with made.session():
            made.until(lambda: made.state == "active" and column(made, 0) and column(made, 1))
            made.sensors["thumb"].say(fault)
            # In one look at the vest; a camera that waits for a core may be silent in another.
            made.until(lambda: [bool(m) for m in seen_by(made.vest).motors[:2]] == [False, True])
            made.until(lambda: "thumb: no picture for" in made.said())
            made.until(lambda: why in made.said())
            # And so it stays; a noisy picture may rest for a moment by itself.
            made.until(lambda: not column(made, 0))
            for _ in range(100):
                assert not column(made, 0)
                time.sleep(0.005)
            assert made.state == "active"
            made.sensors["thumb"].say("clear")
            made.sensors["thumb"].say("press 0.7")
            made.until(lambda: column(made, 0))
            made.until(lambda: "thumb" not in made.said())
        made.until(made.at_rest)


@pytest.mark.parametrize(("fault", "why"), [("pause", ""), ("wear half-lit", "dark: ")])
def test_a_lost_camera_holds_the_hand_where_the_settings_say_so(tmp_path: Path, fault: str, why: str) -> None:
    with lab(
        tmp_path,
        emg=True,
        hand=True,
        fingers=("thumb",),
        recording={"dir": str(tmp_path / "recorded")},
        safety={"tactile_lost": "hold", "hold_ms": 60_000.0},
    ) as made:
        with made.session():
            made.until(lambda: made.state == "active" and closed(made))
            made.sensors["thumb"].say(fault)
            made.until(lambda: made.state == "hold")
            assert "thumb: no picture" in made.changes[-1].reason
            made.until(lambda: why in made.said())
            made.sensors["thumb"].say("clear")
            made.sensors["thumb"].say("press 0.7")
            made.until(lambda: made.state == "active")
        assert made.limp()
    found = inspect_file(tmp_path / "recorded" / made.summary["recording"]["file"])
    assert any("thumb: no picture" in event.text for event in found.states)


KEYS: Final = ("pedal-keyboard", 0x0C45, 0x7403, {"silent_after_ms": 10_000.0})
JOYSTICK: Final = (
    "pedal-repeating",
    0x05F3,
    0x00FF,
    {"report": "joystick", "vendor_id": 0x05F3, "button_byte": 3, "silent_after_ms": 100.0},
)


@contextmanager
def on_foot(
    folder: Path, pedal: tuple[str, int, int, dict[str, Any]], safety: dict[str, Any]
) -> Iterator[tuple[Lab, Emulator]]:
    """Start a lab with a dead-man's pedal; return both."""
    device, vendor, product, options = pedal
    with (
        Emulator("hid_input", "--device", device) as foot,
        HidPort(HidBoard(foot.port, vendor, product)).installed(),
        lab(folder, emg=True, hand=True, safety=safety) as made,
    ):
        made.tree["input"] = {"dead_man": {"driver": "pedal", "options": options}}
        yield made, foot


@pytest.mark.skipif(sys.platform != "linux", reason="the emulated pedal needs Linux")
@pytest.mark.parametrize(
    ("pedal", "how", "reason"),
    [(KEYS, "lift 0", "dead-man"), (KEYS, "unplug", "dead-man"), (JOYSTICK, "freeze", "dead-man: no data")],
    ids=["lifted", "unplugged", "frozen"],
)
def test_a_dead_man_that_is_released_unplugged_or_frozen_holds(
    tmp_path: Path, pedal: tuple[str, int, int, dict[str, Any]], how: str, reason: str
) -> None:
    with on_foot(tmp_path, pedal, {"hold_ms": 60_000.0}) as (made, foot):
        with made.session():
            made.until(lambda: "dead-man: released" in made.said())
            assert made.state == "idle"
            foot.say("press 0")
            made.until(lambda: made.state == "active" and closed(made))
            foot.say(how)
            made.until(lambda: made.state == "hold")
            assert reason in made.changes[-1].reason
            assert closed(made)
            if how == "freeze":
                foot.say("clear")  # the foot is still down: it has to be lifted and put down again
                foot.say("press 0")
                foot.say("lift 0")
                foot.say("press 0")
                made.until(lambda: made.state == "active")
        assert made.limp()


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("hot", "85 °C"),
        ("overheated", "temperature fault"),
        ("foreign", "another program"),
        ("silence", "silent"),
    ],
)
def test_a_hand_in_trouble_is_let_go_and_the_vest_rests(tmp_path: Path, fault: str, words: str) -> None:
    with lab(tmp_path, emg=True, hand=True, vest=True, fingers=("thumb",)) as made:
        with made.session(ends=pytest.raises(DeviceUnavailableError, match=words)):
            made.until(lambda: made.state == "active" and closed(made) and column(made, 0))
            made.hand.say(fault)
            made.until(lambda: made.state == "stopped")
            assert words in made.changes[-1].reason
        assert made.limp() or fault == "silence"  # which receives nothing
        made.until(made.at_rest)


def test_no_torque_is_beyond_the_share_that_is_set() -> None:
    share = 0.02
    with Emulator("allegro_port") as hand:
        hand.say("limit inf " + " ".join(str(limit) for limit in TORQUE_LIMITS * share))
        quiet: Any = {"silent_after_ms": 5000.0, "lowest_rate_hz": 0.0}
        with Allegro(AllegroOptions(**hand.address, **quiet, torque_share=share)) as driver:
            until(lambda: driver.step(5) is not None and hand.say("look")["torques"] > 400)
        assert hand.say("look")["over"] == 0


@pytest.mark.raises("hand's guard")
def test_the_loss_of_the_hand_s_guard_holds_until_there_is_another(tmp_path: Path) -> None:
    with lab(tmp_path, emg=True, hand=True, recording={"dir": str(tmp_path / "recorded")}) as made:
        with made.session():
            made.until(lambda: made.state == "active" and closed(made))
            for pid in hand_guards():
                os.kill(pid, signal.SIGKILL)
            made.until(
                lambda: any("lets go of the hand was lost" in change.reason for change in made.changes)
            )
            made.until(lambda: made.state == "active")
            assert len(hand_guards()) == 1
            made.until(lambda: closed(made))
        assert made.limp()
        assert not hand_guards()
    held = next(k for k, change in enumerate(made.changes) if "lets go of the hand was lost" in change.reason)
    assert made.changes[held].state == "hold"
    assert "active" in states(made)[held:]
    assert any("lets go of the hand was lost" in message for message in made.summary["safety"]["alerts"])
    found = inspect_file(tmp_path / "recorded" / made.summary["recording"]["file"])
    assert any("lets go of the hand was lost" in event.text for event in found.states)


@pytest.mark.raises("vest")
@pytest.mark.parametrize("then", ["go-on", "hold"])
def test_a_lost_vest_is_told_and_the_run_goes_on_or_holds(tmp_path: Path, then: str) -> None:
    safety = {"vest_lost": then, "hold_ms": 60_000.0}
    with lab(tmp_path, emg=True, hand=True, vest=True, fingers=("thumb",), safety=safety) as made:
        with made.session():
            made.until(lambda: made.state == "active" and column(made, 0))
            made.vest.say("refuse")
            made.until(lambda: "vest: not reached" in made.said())
            made.until(lambda: closed(made))
            made.until(lambda: made.state == {"hold": "hold", "go-on": "active"}[then])
            assert ("vest: not reached" in made.changes[-1].reason) == (then == "hold")
            made.vest.say("clear")
            made.until(lambda: column(made, 0))
            made.until(lambda: "vest" not in made.said())
        assert ("hold" in states(made)) == (then == "hold")
        assert made.limp()
        made.until(made.at_rest)


def test_a_late_loop_holds_and_vest_and_hand_rest_meanwhile(tmp_path: Path) -> None:
    hang_now, hanging, rested = threading.Event(), threading.Event(), threading.Event()
    with whole(tmp_path, safety={"late_ms": 400.0}) as made:
        made.tree["hand"]["options"]["reconnects"] = 5

        def hang(_view: object) -> None:
            if hang_now.is_set() and not hanging.is_set():
                hanging.set()
                time.sleep(1.0)
                # Nothing but the watchdogs of vest and hand can let them rest now.
                assert rested.wait(LONGEST_S)

        with made.session(observe=hang):
            made.until(lambda: made.state == "active" and column(made, 0) and closed(made))
            hang_now.set()
            made.until(hanging.is_set)
            made.until(lambda: not column(made, 0) and made.limp())
            rested.set()
            made.until(lambda: "hold" in states(made))
            made.until(lambda: made.state == "active" and column(made, 0) and pushes(made.hand))
    assert rested.is_set()
    late = next(change for change in made.changes if change.state == "hold")
    assert "ms late" in late.reason
    assert made.summary["pacing"]["skipped"] > 0


def test_a_slow_camera_does_not_arm(tmp_path: Path) -> None:
    slow: dict[str, Any] = {"camera_hz": 20.0, "safety": {"lowest_rate_share": 0.5}}
    with lab(tmp_path, vest=True, fingers=("thumb",), **slow) as made, made.session():
        made.until(lambda: "a second come, 60 are expected" in made.said())
        assert made.at_rest()
    assert states(made) == ["stopped"]


def test_without_calibration_nothing_starts(tmp_path: Path) -> None:
    with lab(tmp_path, emg=True, hand=True, vest=True, fingers=("thumb",)) as made:
        made.tree["calibration"] = {}
        # A run that does start measures the finger's greatest touch until it is told to stop.
        ends = threading.Timer(3.0, lambda: made.stop.ask("it has started"))
        ends.start()
        with pytest.raises(CalibrationError, match=r"calibration\.file|no calibration"), made.session():
            pass
        ends.cancel()
        assert made.limp()
        assert made.at_rest()
