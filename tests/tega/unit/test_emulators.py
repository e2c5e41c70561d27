"""The emulators' own bytes, against the published packets, and that they stand on nothing of ours."""

from __future__ import annotations

import random
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tega.errors import DeviceUnavailableError, InvalidValueError
from tega.runtime.clock import ManualClock
from tega_emulators.chords import ChordsBoard
from tega_emulators.faults import Signal
from tega_emulators.process import Emulator

MODULES = (
    "allegro_port",
    "ascii_board",
    "bhaptics_player",
    "bluez_vest",
    "chords",
    "spiker",
    "cyton",
    "digit",
    "hid_bridge",
    "hid_input",
    "lsl",
)


def signal(kind: str, rate_hz: float = 250.0) -> Signal:
    return Signal(rate_hz, random.Random(0), kind)


def test_no_emulator_imports_what_it_is_to_check() -> None:
    code = (
        "import importlib, sys\n"
        f"for name in {MODULES}:\n"
        "    importlib.import_module('tega_emulators.' + name)\n"
        "    ours = ('tega.wire', 'tega._native', 'tega.devices', 'tega.hand')\n"
        "    found = [m for m in sys.modules if m.startswith(ours)]\n"
        "    assert found == [], (name, found)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def chords(generation: int) -> tuple[ChordsBoard, ManualClock]:
    clock = ManualClock()
    board = ChordsBoard(
        signal("flat"), name="NPG-LITE", rate_hz=500, bits=12, n_channels=3, baud=230_400,
        generation=generation, now_s=lambda: clock.now_ns() / 1e9,
    )  # fmt: skip
    return board, clock


def test_chords_sketches_of_2024_hear_a_command_after_a_second_of_silence() -> None:
    board, clock = chords(2024)
    assert (board.receive(b"STOP\n"), board.go_on()) == (b"", b"")
    clock.sleep_until(clock.now_ns() + 900_000_000)
    board.receive(b"WHORU\n")
    clock.sleep_until(clock.now_ns() + 2_000_000_000)
    assert board.go_on() == b""  # STOP and WHORU are one command, and no answer is given to that
    for message, answer in ((b"WHO", b""), (b"RU\n", b""), (b"", b"NPG-LITE\r\n")):
        if message:
            board.receive(message)
        else:
            clock.sleep_until(clock.now_ns() + 1_000_000_000)
        assert board.go_on() == answer
    board.receive(b"START\n")
    clock.sleep_until(clock.now_ns() + 999_000_000)
    board.go_on()
    assert not board.streaming
    clock.sleep_until(clock.now_ns() + 1_000_000)
    board.go_on()
    board.go_on()
    assert board.streaming
    board.receive(b"x")  # the timer's routine stops at any byte that waits
    assert not board.streaming


def test_chords_sketches_of_2026_take_lines_and_are_deaf_while_they_blink() -> None:
    board, clock = chords(2026)
    board.receive(b"whoru\nNAME\nSTART\nSTATUS\n")
    assert board.go_on() == b"NPG-LITE\r\nUNKNOWN COMMAND\r\n"
    clock.sleep_until(clock.now_ns() + 400_000_000)
    assert board.go_on() == b"RUNNING\r\n"
    assert board.streaming
    board.receive(b"STATUS\n")
    clock.sleep_until(clock.now_ns() + 999_000_000)
    assert board.go_on() == b""
    clock.sleep_until(clock.now_ns() + 1_000_000)
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
