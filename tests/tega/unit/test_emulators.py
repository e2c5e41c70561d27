"""The emulators' own bytes against the published packets; they stand on nothing of ours, and move as typed."""

from __future__ import annotations

import random
import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tega.devices import driver_class
from tega.errors import DeviceUnavailableError, InvalidValueError
from tega.runtime.clock import ManualClock
from tega_emulators.chords import ChordsBoard
from tega_emulators.emulated_bench import EmulatedBench
from tega_emulators.faults import Signal
from tega_emulators.process import Emulator

CODE = """
import importlib, sys
modules = "allegro_port ascii_board bhaptics_player bluez_vest chords spiker cyton digit hid_bridge hid_input lsl"
for name in modules.split():
    importlib.import_module("tega_emulators." + name)
    found = [m for m in sys.modules if m.startswith(("tega.wire", "tega._native", "tega.devices", "tega.hand"))]
    assert found == [], (name, found)
"""


def test_no_emulator_imports_what_it_is_to_check() -> None:
    subprocess.run([sys.executable, "-c", CODE], check=True)


def chords(generation: int) -> tuple[ChordsBoard, Callable[[int], None]]:
    """Return a board, and what lets so many milliseconds pass for it."""
    clock = ManualClock()
    board = ChordsBoard(
        Signal(250.0, random.Random(0), "flat"), name="NPG-LITE", rate_hz=500, bits=12, n_channels=3, baud=230_400,
        generation=generation, now_s=lambda: clock.now_ns() / 1e9,
    )  # fmt: skip
    return board, lambda ms: clock.sleep_until(clock.now_ns() + ms * 1_000_000)


def test_chords_sketches_of_2024_hear_a_command_after_a_second_of_silence() -> None:
    board, wait = chords(2024)
    assert (board.receive(b"STOP\n"), board.go_on()) == (b"", b"")
    wait(900)
    board.receive(b"WHORU\n")
    wait(2_000)
    assert board.go_on() == b""  # STOP and WHORU are one command, and no answer is given to that
    for message in (b"WHO", b"RU\n"):
        board.receive(message)
        assert board.go_on() == b""
    wait(1_000)
    assert board.go_on() == b"NPG-LITE\r\n"
    board.receive(b"START\n")
    wait(999)
    board.go_on()
    assert not board.streaming
    wait(1)
    board.go_on()
    board.go_on()
    assert board.streaming
    board.receive(b"x")  # the timer's routine stops at any byte that waits
    assert not board.streaming


def test_chords_sketches_of_2026_take_lines_and_are_deaf_while_they_blink() -> None:
    board, wait = chords(2026)
    board.receive(b"whoru\nNAME\nSTART\nSTATUS\n")
    assert board.go_on() == b"NPG-LITE\r\nUNKNOWN COMMAND\r\n"
    wait(400)
    assert board.go_on() == b"RUNNING\r\n"
    assert board.streaming
    board.receive(b"STATUS\n")
    wait(999)
    assert board.go_on() == b""
    wait(1)
    assert board.go_on() == b"STOPPED\r\n"


# One of each loop of commands: that of serial boards, that of vests, and one of its own.
@pytest.mark.parametrize("module", ["cyton", "hid_bridge", "digit"])
def test_an_emulator_answers_what_it_does_not_understand_and_lives(module: str, tmp_path: Path) -> None:
    with Emulator(module, *([str(tmp_path)] if module == "hid_bridge" else [])) as device:
        assert device.address
        for line in ("nonsense", "freeze firmly", "{}"):
            with pytest.raises(InvalidValueError, match=re.escape(repr(line))):
                device.say(line)
        device.say("freeze")
        device.say("clear")
        device.kill()
        with pytest.raises(DeviceUnavailableError, match="does not run"):
            device.say("clear")


@pytest.mark.slow
def test_a_line_that_is_no_move_is_refused_with_the_moves() -> None:
    bench = EmulatedBench()
    for line in ("dance", "squeeze 2", "squeeze hard", "squeeze 1 9", "press", "press elbow", "rest 1"):
        with pytest.raises(InvalidValueError, match="is no move") as found:
            bench.moves.act(line)
        assert "squeeze" in found.value.hint


@pytest.mark.slow
def test_muscles_squeeze_one_by_one() -> None:
    with EmulatedBench() as bench:
        amplifier = bench.looked["cyton"].found[0]
        options = driver_class("cyton").options_type(**amplifier.options, measure_s=0.5)
        with driver_class("cyton", "emg")(options) as source:

            def strengths() -> np.ndarray:
                until_s = time.monotonic() + 1.0
                while time.monotonic() < until_s:  # what was measured before the move
                    source.read(0.2)
                samples = [one.samples for _ in range(20) if (one := source.read(1.0)) is not None]
                return np.asarray(np.concatenate(samples).std(axis=0))

            bench.moves.act("rest")
            at_rest = strengths()
            bench.moves.act("squeeze 0.5 2")
            alone = strengths()
        assert alone[1] > 5 * at_rest[1]
        assert alone[0] < 2 * at_rest[0] + 1.0
