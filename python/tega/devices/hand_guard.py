"""Lets go of a hand whose program was killed or stands still.

A hand is thought to keep its last torque for ever. So a second process waits beside the one that steers it,
``python -m tega.devices.hand_guard SETTINGS``, and hears from the hand's thread ten times a second. A line ``done``
ends it. When its input ends without one, or it hears nothing for a second, it opens the bus itself and sends zero
torque, SERVO OFF and no more reports, three times. Until it first hears something no motor is on, and it does nothing.
Nothing helps where both are killed, the adapter is pulled out, or the machine loses power: mount a switch.
"""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from tega.wire import CanFrame

__all__ = ["Guard", "main"]

BEAT_S: Final = 0.1
STUCK_S: Final = 1.0
_TRIES: Final = 10
_REST_S: Final = 0.2
_AGAIN_S: Final = 0.02


class Guard:
    """The guard's process, as seen by the program it watches.

    Args:
        bus: Arguments of ``can.Bus``.
        frames: What leaves the hand without force.
    """

    def __init__(self, bus: Mapping[str, Any], frames: Sequence[CanFrame]) -> None:
        settings = json.dumps({"bus": bus, "frames": [[f.id, f.data.hex()] for f in frames]})
        # A session of its own: what is sent to the program's terminal (Ctrl-C, hang-up) is not meant for it.
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tega.devices.hand_guard", settings],
            stdin=subprocess.PIPE,
            start_new_session=True,
        )
        if self._process.stdin is not None:
            os.set_blocking(self._process.stdin.fileno(), False)
        self._next_s = 0.0

    def beat(self) -> None:
        """Say that the hand's thread is alive; returns at once, and does nothing most of the time."""
        now_s = time.monotonic()
        if now_s < self._next_s or self._process.stdin is None:
            return
        self._next_s = now_s + BEAT_S
        try:
            os.write(self._process.stdin.fileno(), b".\n")
        except OSError:  # it was killed: nothing more can be done about that here
            self._next_s = float("inf")

    def dismiss(self) -> None:
        """Tell it that the hand was let go."""
        try:
            self._process.communicate(b"done\n", timeout=5)
        except (subprocess.TimeoutExpired, OSError):
            self._process.kill()
            self._process.wait()


def _let_go(bus: dict[str, Any], frames: list[list[Any]]) -> None:
    """Send the frames, as often as opening the bus takes."""
    import can

    for _ in range(_TRIES):
        try:
            with can.Bus(**bus) as opened:
                for _ in range(3):
                    for can_id, data in frames:
                        opened.send(
                            can.Message(arbitration_id=can_id, data=bytes.fromhex(data), is_extended_id=False)
                        )
                    time.sleep(_AGAIN_S)
        except (can.CanError, OSError, ValueError):
            time.sleep(_REST_S)
            continue
        return


def main() -> None:
    """Wait, and let go of the hand if its program ends without a word or stands still."""
    import can  # noqa: F401  # there is no time for that later

    settings = json.loads(sys.argv[1])
    fd = sys.stdin.fileno()
    heard, stuck, said = False, False, b""
    while True:
        ready, _, _ = select.select([fd], [], [], STUCK_S if heard and not stuck else None)
        chunk = os.read(fd, 4096) if ready else b""
        said = (said + chunk)[-64:]
        if b"done" in said:
            return
        if chunk:
            heard, stuck = True, False
            continue
        if heard:
            _let_go(settings["bus"], settings["frames"])
        if ready:
            return
        stuck = True


if __name__ == "__main__":
    main()
