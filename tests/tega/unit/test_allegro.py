"""The Allegro driver against the emulated hand in another process, behind a serial CAN adapter.

Exact deadlines are tried in the Rust tests, where time is a number; here a busy machine must not matter, so silence
is only noticed after a second.
"""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.hand_bench import PATIENT, driver, limp, pushes
from reference.played import muscles
from reference.processes import until
from tega.config import check_tree
from tega.devices import driver_class
from tega.devices.hand.allegro import Allegro
from tega.errors import ConfigError, DeviceUnavailableError, WrongDeviceError
from tega.hand import CLOSURE_POSES_RAD
from tega.loop import run_session
from tega_emulators.allegro import FAULTS, AllegroNode
from tega_emulators.process import Emulator

pytestmark = pytest.mark.slow


def _reach(steered: Allegro, level: int, added: float = 0.0) -> None:
    below, above = CLOSURE_POSES_RAD[level - 1], CLOSURE_POSES_RAD[level]
    wanted = below + added * (above - below)

    def near() -> bool:
        steered.step(level, added)
        target = steered.target_rad
        there = target is not None and np.abs(target - wanted).max() < 1e-6
        return bool(there and np.abs(steered.angles_rad - wanted).max() < 0.03)

    until(near)


def test_the_emulated_hand_says_what_a_real_one_said() -> None:
    node = AllegroNode()
    # Bytes of the fact sheet: information of a 4.2 hand with firmware 4.6, right; temperatures one byte a joint.
    (can_id, data), *_ = node.receive(0x200, b"", remote=True, t_s=0.0)
    assert (can_id, data[:5]) == (0x200, bytes.fromhex("0204060400"))
    assert node.receive(0x0E4, b"", remote=True, t_s=0.0) == [(0x0E4, bytes([36] * 4))]
    assert node.due(1.0) == []
    node.receive(0x204, bytes.fromhex("03000000F4010000"), remote=False, t_s=1.0)
    assert [frame[0] for frame in node.due(1.0035)] == [0x080, 0x084, 0x088, 0x08C]
    node.receive(0x180, bytes.fromhex("7800 10FF 3C00 C4FF"), remote=False, t_s=1.01)
    assert [round(float(d), 4) for d in node.duties[:4]] == [0.1, -0.2, 0.05, -0.05]
    assert node.receive(0x201, b"", remote=True, t_s=1.0) == []


def test_it_steers_on_the_angles_it_reads_and_lets_go() -> None:
    with Emulator("allegro_port", "--seed", "3") as hand:
        with driver(hand) as steered:
            _reach(steered, 4)
            truth = hand.say("look")
            assert truth["servo_on"]
            assert np.abs(steered.angles_rad - truth["angles_rad"]).max() < 0.02
            until(lambda: None not in steered.state().joints_c)
            until(lambda: {f.id for f in steered.step(1)} >= {0x180, 0x184, 0x188, 0x18C})
            assert "firmware 4.6" in steered.info.notes[0]
        assert limp(hand)
        assert not hand.say("look")["reports"]
        with pytest.raises(DeviceUnavailableError):
            steered.step(1)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [(("--hardware", "0x0500"), "version 5.0"), (("--side", "left"), "left hand")],
)
def test_another_hand_is_refused_before_any_torque(arguments: tuple[str, ...], words: str) -> None:
    with Emulator("allegro_port", *arguments) as hand:
        with pytest.raises(WrongDeviceError, match=words):
            driver(hand).open()
        assert limp(hand)
        assert not hand.say("look")["reports"]


def test_what_is_added_reaches_the_hand_through_its_process_and_is_taken_back() -> None:
    reported: set[tuple[float, float]] = set()
    with Emulator("allegro_port") as hand:
        steered = driver(hand)
        steered.on_exchange = lambda spoken: reported.add((spoken.level, spoken.added))
        with steered:
            for added in (0.0, 0.5, 0.25, 0.0):
                _reach(steered, 3, added)
    assert {(3.0, 0.5), (3.0, 0.25), (3.0, 0.0)} <= reported


@pytest.mark.parametrize("word", [(3.0, math.nan), (math.nan, 0.0), (3.0, -0.5), (3.0, 2.0), (7.0, 0.5)])
def test_a_hostile_word_to_the_hand_s_process_has_it_let_go(word: tuple[float, float]) -> None:
    with Emulator("allegro_port") as hand, driver(hand) as steered:
        _reach(steered, 3)
        steered._check().say(*word)
        until(lambda: limp(hand))
        with pytest.raises(DeviceUnavailableError, match=r"(level|added) = "):
            steered.step(3)


def test_nobody_there() -> None:
    with (
        Emulator("allegro_port", "--device-id", "2") as hand,
        pytest.raises(DeviceUnavailableError, match="20 requests") as got,
    ):
        driver(hand).open()
    assert "12 V" in got.value.hint


ENDS = {
    "silence": "fell silent",
    "freeze": "single count",
    "half": "ring finger sends no",
    "hot": "85 °C",
    "overheated": "temperature fault",
    "jump": "jumps by",
    "foreign": "another program",
    "slow": "times a second",
    "gone": "adapter failed",
}
GOES_ON = {"drop", "duplicate", "babble", "power-cycle"}


def test_every_fault_of_the_emulated_hand_is_tried() -> None:
    assert set(ENDS) - {"gone"} | GOES_ON == set(FAULTS)


@pytest.mark.parametrize("fault", sorted(ENDS))
def test_a_fault_lets_go_of_the_hand_and_says_why(fault: str) -> None:
    lowest_hz = 150.0 if fault == "slow" else 50.0
    with (
        Emulator("allegro_port") as hand,
        driver(hand, reconnects=1, silent_after_ms=300.0, lowest_rate_hz=lowest_hz) as steered,
    ):
        steered.step(2)
        if fault == "gone":
            hand.kill()
        else:
            hand.say(fault)
        with pytest.raises(DeviceUnavailableError, match=ENDS[fault]) as got:
            until(lambda: steered.step(5) is None)
        assert got.value.hint
        # What hears nothing cannot be told; its motors keep their last duty.
        if fault not in {"silence", "gone"}:
            until(lambda: limp(hand))


@pytest.mark.parametrize("fault", [*sorted(GOES_ON), "garbage"])
def test_a_nuisance_is_survived(fault: str) -> None:
    with Emulator("allegro_port") as hand, driver(hand, silent_after_ms=300.0) as steered:
        hand.say(fault)

        def reported() -> bool:
            steered.step(4)
            counts = steered.state().counts
            return {
                "drop": counts.incomplete,
                "duplicate": counts.copies,
                "babble": min(counts.unknown, counts.malformed),
                "power-cycle": counts.silences,
                "garbage": steered.news.n_garbled,
            }[fault] > 10 * (fault != "power-cycle")

        until(reported)
        counted = steered.state().counts.sets
        until(lambda: steered.state().counts.sets > counted + 100)
        until(lambda: bool(hand.say("look")["servo_on"]))
        assert any(hand.say("look")["duties"])


@pytest.mark.parametrize("end", ["", "raise SystemExit(3)", "raise ValueError"])
def test_a_program_that_forgets_to_close_still_lets_go(end: str) -> None:
    with Emulator("allegro_port") as hand:
        program = (
            "import time\n"
            "from tega.devices.hand.allegro import Allegro, AllegroOptions\n"
            f"driver = Allegro(AllegroOptions(**{ ({**hand.address, **PATIENT})!r}))\n"
            f"driver.open()\ndriver.step(5)\ntime.sleep(0.5)\nprint(driver.state().phase)\n{end}\n"
        )
        message = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
        assert message.stdout.strip() == "running"
        assert limp(hand)
        assert not hand.say("look")["reports"]


def test_a_pose_file_that_is_missing_is_refused() -> None:
    make: Any = driver_class("allegro", "hand").options_type
    with pytest.raises(ConfigError, match=r"none\.toml"):
        Allegro(make(interface="virtual", channel="x", poses=Path("none.toml"))).open()


def test_a_session_steers_the_hand_it_reads(tmp_path: Path) -> None:
    with Emulator("allegro_port") as hand:
        settings = {**hand.address, **PATIENT}
        tree = {
            "session": {"pace": "real", "out_dir": str(tmp_path / "out")},
            "emg": muscles(1.5, seed=1),
            "tactile": {"thumb": {"driver": "synthetic-touch", "options": {"duration_s": 3.5}}},
            "safety": {"hold_ms": 500.0},
            "hand": {"driver": "allegro", "options": settings},
        }
        summary = run_session(check_tree(tree, {}, base=tmp_path).config)
        assert limp(hand)
        # A hand does not hold for ever what a recording ended with.
        changes = [(one["state"], one["reason"]) for one in summary["safety"]["changes"]][-3:]
        assert changes[0] == ("hold", "emg: its recording has ended")
        assert [state for state, _ in changes[1:]] == ["idle", "stopped"]
        assert summary["hand"]["model"] == Allegro.label
        assert summary["hand"]["sinks"] == ["allegro", "can-recorder"]
        sent = (tmp_path / "out" / "can.csv").read_text().splitlines()
        assert sum(",180," in line for line in sent) > 100


def test_an_adapter_that_opens_slowly_is_waited_for_and_a_silent_hand_says_so() -> None:
    with (
        Emulator("allegro_port") as hand,
        driver(hand, silent_after_ms=300.0, bus={"sleep_after_open": 2.0}) as steered,
    ):
        until(lambda: not steered.silent)
        hand.say("power-cycle")
        until(lambda: bool(steered.step(3)) and steered.state().counts.silences > 0)
        until(lambda: steered.silent)
        assert np.isfinite(steered.angles_rad).all(), "the last ones stand"
        until(lambda: not steered.silent and steered.state().phase == "running")
        until(lambda: (steered.step(3), pushes(hand))[1])
