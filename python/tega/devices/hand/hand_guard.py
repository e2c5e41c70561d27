"""Let go of a hand whose program was killed or stands still.

A hand is thought to keep its last torque for ever. So a process waits beside the one that steers it
(:mod:`tega.devices.hand.guard_process`), and hears from that ten times a second, while that hears from its program.
When its input ends without a word, or it hears nothing for a second, it opens the bus itself and sends zero torque,
SERVO OFF and no more reports, until the hand
says that its motors are off: for ten minutes after the program is gone, or until a program that stood still goes on.
Until it first hears something no motor is on, and it does nothing. Nothing helps where both are killed, the adapter is
pulled out, or the machine loses power: mount a switch. On Windows a serial adapter belongs to one program at a time, so
there it can be opened only when the program is gone, and a program that stands still keeps it (untried).
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from tega.devices.hand.guard_process import GuardProcess, stand_by
from tega.devices.hand.hand_bus import HandBus
from tega.errors import DeviceUnavailableError

if TYPE_CHECKING:
    from tega.wire import CanFrame


LONGEST_S: Final = 600.0
_REST_S: Final = 0.2
_TRY_S: Final = 0.5


def guard_hand(bus: Mapping[str, Any], frames: Sequence[CanFrame], *, device_id: int) -> GuardProcess:
    """Start the process that guards a hand, and return it when it is ready.

    Args:
        bus: Arguments of ``can.Bus``.
        frames: What leaves the hand without force.
        device_id: The hand's number on its bus.

    Raises:
        DeviceUnavailableError: It does not start.
    """
    settings = {"bus": bus, "frames": [[f.id, f.data.hex()] for f in frames], "device_id": device_id}
    return GuardProcess("lets go of the hand", "tega.devices.hand.hand_guard", json.dumps(settings))


class _Hand:
    """The hand, from here."""

    def __init__(self, bus: dict[str, Any], frames: list[list[Any]], device_id: int) -> None:
        from tega.wire import CanFrame

        more = dict(bus)
        interface, self._channel = more.pop("interface"), more.pop("channel")
        self._bus = HandBus(interface, self._channel, bitrate=more.pop("bitrate"), more=more)
        self._frames = [CanFrame(can_id, bytes.fromhex(data)) for can_id, data in frames]
        self._device_id = device_id
        self._node = self._seen()

    def let_go(self, given_up: Callable[[], bool]) -> None:
        """Tell it to let go until it has confirmed that it did, or nobody needs that any more."""
        until_s = time.monotonic() + LONGEST_S
        while time.monotonic() < until_s and not self._replaced():
            try:
                self._bus.open()
                if self._bus.switch_off(self._frames, device_id=self._device_id, patience_s=_TRY_S):
                    return
            except DeviceUnavailableError:
                pass
            finally:
                self._bus.drop()
            if given_up():
                return
            time.sleep(_REST_S)

    def _replaced(self) -> bool:
        """Whether another program's terminal has the name now that an emulated adapter had."""
        return str(self._channel).startswith("/dev/pts/") and self._seen() != self._node

    def _seen(self) -> tuple[int, int] | None:
        try:
            seen = Path(str(self._channel)).stat()
        except OSError:
            return None
        return seen.st_ino, seen.st_ctime_ns


def main() -> None:
    """Wait, and let go of the hand if its program ends without a word or stands still."""
    import can  # noqa: F401  # there is no time for that later

    hand = _Hand(**json.loads(sys.argv[1]))
    stand_by(hand.let_go)


if __name__ == "__main__":
    main()
