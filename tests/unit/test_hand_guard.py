"""A hand is let go of even if the program that steers it is killed or stands still."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from reference.waiting import until
from tega.testing.emulators.process import Emulator


@contextmanager
def steering(hand: Emulator) -> Iterator[subprocess.Popen[bytes]]:
    """Run a program that closes the hand and never lets go of it by itself."""
    program = (
        "import signal, time\n"
        "signal.signal(signal.SIGHUP, signal.SIG_DFL)\n"  # tests may themselves run under nohup
        "from tega.devices.allegro import Allegro, AllegroOptions\n"
        f"options = dict({hand.address!r}, silent_after_ms=1000.0, lowest_rate_hz=50.0)\n"
        "hand = Allegro(AllegroOptions(**options))\n"
        "hand.open()\n"
        "while True:\n"
        "    hand.step(5)\n"
        "    time.sleep(0.003)\n"
    )
    with subprocess.Popen([sys.executable, "-c", program]) as running:
        until(lambda: bool(hand.say("look")["servo_on"] and any(hand.say("look")["duties"])))
        try:
            yield running
        finally:
            running.kill()


def limp(hand: Emulator) -> bool:
    """Whether no motor pushes."""
    state = hand.say("look")
    return not state["servo_on"] and not any(state["duties"])


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_a_killed_or_frozen_program_does_not_leave_the_hand_pushing(how: signal.Signals) -> None:
    with Emulator("allegro_port") as hand, steering(hand) as running:
        running.send_signal(how)
        until(lambda: limp(hand))
        until(lambda: not hand.say("look")["reports"])


def test_a_closed_terminal_lets_go_of_the_hand() -> None:
    with Emulator("allegro_port") as hand, steering(hand) as running:
        running.send_signal(signal.SIGHUP)
        assert running.wait() == 128 + signal.SIGHUP
        until(lambda: limp(hand))
