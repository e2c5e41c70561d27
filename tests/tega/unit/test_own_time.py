"""A hand is answered, and a board's samples are stamped, on their own time, whatever else the program does."""

from __future__ import annotations

import ctypes
import sys
import time

import pytest

from reference.hand_bench import driver, pushes
from reference.processes import until
from tega.devices.emg.live_serial import SerialPort
from tega_emulators.process import Emulator

pytestmark = pytest.mark.slow

TICK_MS = 3.0
TIMES = 10
HELD_US = 200_000


def hold() -> None:
    """Sleep in a function of C that is called so that it keeps the interpreter's lock."""
    ctypes.PyDLL(None).usleep(HELD_US)


@pytest.mark.skipif(sys.platform == "win32", reason="its C library has no usleep")
@pytest.mark.asked_again("a machine that is busy for 30 ms answers nobody")
def test_the_hand_is_answered_in_time_while_the_interpreter_lock_is_held() -> None:
    with Emulator("allegro_port") as hand, driver(hand) as steered:
        until(lambda: (steered.step(3), pushes(hand))[1])
        hand.say("answers")
        for _ in range(3):
            steered.step(4)
            hold()
        answers_ms = hand.say("answers")["answers_ms"]
    assert len(answers_ms) > 3 * HELD_US / 1000 / TICK_MS / TIMES
    assert max(answers_ms) < TIMES * TICK_MS


RATE_HZ = 200
BURST_MS = 50
N_HELD = 6
# The system wakes the thread, and the board tells the time of a packet after the last of a burst.
LATE_NS = 8_000_000


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere whoever reads drains the port")
@pytest.mark.asked_again("a machine that is busy for 8 ms wakes nobody")
def test_bytes_are_stamped_as_they_come_while_the_interpreter_lock_is_held() -> None:
    board = ("--rate", str(RATE_HZ), "--burst-ms", str(BURST_MS), "--stamp")
    stamps: list[tuple[int, int]] = []
    with Emulator("ascii_board", *board) as emulator:
        port = SerialPort(emulator.port, 115_200, driver="test")
        try:
            text = port.read_until(b"\r\n", 5.0)
            for _ in range(N_HELD):
                hold()
                data, arrival_ns = port.arrived()
                text += data
                whole, _, _ = text.rpartition(b"\r\n")
                newest = round(int(whole.rpartition(b"\n")[2].split(b",")[0]) * RATE_HZ / 1000)
                stamps.append((newest, arrival_ns))
                time.sleep(0.013)  # another part of a burst's period
        finally:
            port.close()
        sent_ns = emulator.say("sent")["sent_ns"]
    lines = [line.split(b",") for line in text.split(b"\r\n")[1:-1]]
    numbers = [round(int(line[0]) * RATE_HZ / 1000) for line in lines]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers))), "no line is lost"
    assert len(numbers) > N_HELD * HELD_US / 1e6 * RATE_HZ / 2
    late_ns = [arrival_ns - sent_ns[newest] for newest, arrival_ns in stamps]
    assert max(late_ns) < LATE_NS
