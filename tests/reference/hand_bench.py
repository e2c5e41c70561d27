"""The emulated hand with its driver, patient as a busy machine needs it, and a program that closes it for ever."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from reference.processes import below, until
from tega.devices.hand.allegro import Allegro
from tega.devices.hand.allegro_options import AllegroOptions
from tega_emulators.process import Emulator

PATIENT: dict[str, Any] = {"silent_after_ms": 1000.0, "lowest_rate_hz": 50.0}


def patient(hand: Emulator, **options: Any) -> AllegroOptions:
    """Return the driver's options for a machine on which a hand may be silent for a second."""
    return AllegroOptions(**{**hand.address, **PATIENT, **options})


def driver(hand: Emulator, **options: Any) -> Allegro:
    return Allegro(patient(hand, **options))


def limp(hand: Emulator) -> bool:
    state = hand.say("look")
    return not state["servo_on"] and not any(state["duties"])


def pushes(hand: Emulator) -> bool:
    state = hand.say("look")
    return bool(state["servo_on"] and any(state["duties"]))


@contextmanager
def steering(
    hand: Emulator, folder: Path | None = None, *, guard: bool = True
) -> Iterator[subprocess.Popen[bytes]]:
    """Run a program that closes the hand and never lets go of it by itself, in a working folder."""
    program = (
        "import signal, time\n"
        "signal.signal(signal.SIGHUP, signal.SIG_DFL)\n"  # tests may themselves run under nohup
        "from tega.devices.hand.allegro import Allegro, AllegroOptions\n"
        f"hand = Allegro(AllegroOptions(**{ {**hand.address, **PATIENT}!r}, guard={guard}))\n"
        "hand.open()\n"
        "lost = False\n"
        "while True:\n"
        "    hand.step(5)\n"
        "    time.sleep(0.003)\n"
        "    if lost and not hand.guard_problem:\n"
        "        print('replaced', flush=True)\n"
        "    lost = bool(hand.guard_problem)\n"
    )
    words = [sys.executable, "-P", "-c", program]
    with subprocess.Popen(words, cwd=folder, stdout=subprocess.PIPE) as running:

        def closed() -> bool:
            assert running.poll() is None, "the program has ended; its error output says why"
            return pushes(hand)

        try:
            until(closed)
            yield running
        finally:
            for pid in below(running.pid):  # none is left behind stopped
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGCONT)
            running.kill()
