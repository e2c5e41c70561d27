"""The hand is answered on its own time, whatever else the program that steers it does."""

from __future__ import annotations

import ctypes
import sys
from typing import Any

import pytest

from reference.waiting import until
from tega.devices.hand.allegro import Allegro
from tega.devices.hand.allegro_options import AllegroOptions
from tega_emulators.process import Emulator

pytestmark = pytest.mark.slow

TICK_MS = 3.0
TIMES = 10
HELD_US = 200_000


@pytest.mark.skipif(sys.platform == "win32", reason="its C library has no usleep")
@pytest.mark.asked_again("a machine that is busy for 30 ms answers nobody")
def test_the_hand_is_answered_in_time_while_the_interpreter_lock_is_held() -> None:
    make: Any = AllegroOptions
    # Called through this, a function of C keeps the lock.
    hold = ctypes.PyDLL(None).usleep
    with (
        Emulator("allegro_port") as hand,
        Allegro(make(**hand.address, silent_after_ms=1000.0, lowest_rate_hz=50.0)) as driver,
    ):
        until(lambda: (driver.step(3), any(hand.say("look")["duties"]))[1])
        hand.say("answers")
        for _ in range(3):
            driver.step(4)
            hold(HELD_US)
        answers_ms = hand.say("answers")["answers_ms"]
    assert len(answers_ms) > 3 * HELD_US / 1000 / TICK_MS / TIMES
    assert max(answers_ms) < TIMES * TICK_MS
