"""The emulators' own bytes, against the published packets, and that they stand on nothing of ours."""

from __future__ import annotations

import os
import random
import re
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from tega.errors import DeviceUnavailableError, InvalidValueError
from tega.runtime.clock import ManualClock
from tega_emulators.ascii_board import AsciiBoard
from tega_emulators.chords import ChordsBoard
from tega_emulators.cyton import CytonBoard
from tega_emulators.faults import FAULTS, Faults, Signal
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
        "    found = [m for m in sys.modules if m.startswith(('tega.wire', 'tega._native', 'tega.devices'))]\n"
        "    assert found == [], (name, found)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_cyton_packets_are_the_published_bytes() -> None:
    board = CytonBoard(signal("flat"))
    board.power_on()
    assert board.packet().hex() == "a000" + "000000" * 8 + "000000001f40" + "c0"
    assert board.packet().hex() == "a001" + "000000" * 8 + "000000000000" + "c0"
    board = CytonBoard(signal("ramp"))
    board.power_on()
    # Steps -500, -400, ... 200 of 100 counts: -50000 is 0xFF3CB0.
    counts = "ff3cb0" + "ff63c0" + "ff8ad0" + "ffb1e0" + "ffd8f0" + "000000" + "002710" + "004e20"
    assert board.packet().hex() == "a000" + counts + "000000001f40" + "c0"
    board = CytonBoard(signal("rail"))
    board.power_on()
    assert [board.packet()[2:5].hex() for _ in range(257)][-1] == "7fffff"
    assert board.packet()[1] == 1


def test_a_cyton_answers_in_text_only_while_it_does_not_stream() -> None:
    board = CytonBoard(signal("flat"))
    board.power_on()
    assert board.receive(b"v").endswith(b"Firmware: v3.1.2\r\n$$$")
    assert board.receive(b"x106") == b""
    assert board.receive(b"0100X") == b"Success: Channel set for 1$$$"
    assert board.receive(b"x9060100X").startswith(b"Failure")
    assert board.receive(b"bv") != b""
    assert board.receive(b"b") == b""
    assert board.receive(b"d") == b""


def chords(generation: int) -> tuple[ChordsBoard, ManualClock]:
    clock = ManualClock()
    board = ChordsBoard(
        signal("flat"), name="NPG-LITE", rate_hz=500, bits=12, n_channels=3, baud=230_400,
        generation=generation, now_s=lambda: clock.now_ns() / 1e9,
    )  # fmt: skip
    return board, clock


@pytest.mark.parametrize(("generation", "first"), [(2024, 0), (2026, 1)])
def test_chords_packets_are_the_published_bytes(generation: int, first: int) -> None:
    board, _ = chords(generation)
    for n in (first, first + 1):
        assert board.packet().hex() == f"c77c{n:02x}" + "0800" * 3 + "01"
    for _ in range(253 - first):
        board.packet()
    assert (board.packet()[2], board.packet()[2]) == (255, 0)


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


def test_lines_are_what_arduino_prints() -> None:
    board = AsciiBoard(signal("ramp"), rate_hz=500, n_channels=3, baud=0, stamp=True, banner="MyoWare")
    assert board.power_on() == b"MyoWare\r\n"
    assert [board.packet() for _ in range(2)] == [b"0,12,112,212\r\n", b"2,13,113,213\r\n"]


def test_faults_do_what_they_say() -> None:
    faults, packet = Faults(random.Random(1)), bytes(range(33))
    assert faults.pass_on(packet) == packet
    expected = {"loss": 0, "duplicate": 66}
    for name, length in expected.items():
        faults.set(name, 1.0)
        assert len(faults.pass_on(packet)) == length
        faults.clear()
    faults.set("half", 1.0)
    halves = [faults.pass_on(packet) for _ in range(50)]
    assert all(0 < len(h) < 33 and packet.startswith(h) for h in halves)
    with pytest.raises(KeyError):
        faults.set("nonsense", 1.0)
    with pytest.raises(ValueError, match=r"1\.5"):
        faults.set("loss", 1.5)


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


def test_a_board_on_a_serial_port_refuses_bad_numbers_and_tells_its_new_port() -> None:
    with Emulator("cyton") as device:
        device.say("loss 0.5")
        for line in ("loss 7", "signal nothing", "slow fast"):
            with pytest.raises(InvalidValueError, match=line):
                device.say(line)
        assert set(FAULTS) >= {"loss", "half", "noise", "duplicate", "garbage", "freeze", "slow"}
        device.say("unplug")
        device.say("plug")
        assert Path(device.port).is_char_device()


def test_an_emulator_that_cannot_start_says_so(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(DeviceUnavailableError, match="cyton has ended"), Emulator("cyton", "--no-such"):
        pass
    assert "--no-such" in capfd.readouterr().err


def test_a_network_stream_refuses_faults_that_only_a_wire_has() -> None:
    pytest.importorskip("pylsl", reason="needs the extra tega[lsl]")
    with Emulator("lsl") as device:
        with pytest.raises(ValueError, match="garbage"):
            device.say("garbage")
        device.say("loss 0.1")


def test_a_player_says_nothing_of_who_only_looks_whether_its_port_is_open(
    capfd: pytest.CaptureFixture[str],
) -> None:
    with Emulator("bhaptics_player", "--port", "0") as player:
        for _ in range(3):
            socket.create_connection(("127.0.0.1", player.port), 5.0).close()
        with socket.create_connection(("127.0.0.1", player.port), 5.0) as knock:
            knock.sendall(b"no handshake\r\n\r\n")
            while knock.recv(4096):
                pass
        player.say("look")
    assert capfd.readouterr().err == ""


def test_a_port_that_vanished_comes_back_as_no_other_program_s() -> None:
    with Emulator("cyton") as board:
        gone = board.port
        board.say("unplug")
        assert not Path(gone).exists()
        ours, theirs = os.openpty()
        try:
            assert os.ttyname(theirs) != gone
        finally:
            os.close(ours)
            os.close(theirs)
