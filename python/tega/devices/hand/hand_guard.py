"""Release a hand if its program was killed or hangs.

A hand is believed to keep its last torque forever. So a process waits beside the one that steers it
(:mod:`tega.devices.hand.guard_process`), and receives a message from it ten times a second, as that one does from its
program. When its input ends without notice, or no message comes for a second, it opens the bus itself and sends zero
torque, SERVO OFF and no more reports, until the hand confirms that its motors are off: for ten minutes after the
program is gone, or until a program that hung continues. Before its first message no motor is on, and it does nothing.
A run that has lost both processes starts a guard at once (:func:`take_over`). Nothing helps if the run is killed with
them, the adapter is pulled out, or the machine loses power: mount a switch. On Windows a serial adapter belongs to
one program at a time. There the guard can open it only when the program is gone, and a program that hangs keeps it
(untested).
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from tega.devices.hand.allegro_options import AllegroOptions
from tega.devices.hand.guard_process import GuardProcess, stand_by
from tega.devices.hand.hand_bus import HandBus, bus_label, load_can, off_frames
from tega.errors import DeviceUnavailableError
from tega.runtime.child_process import is_running
from tega.wire import CanFrame

LONGEST_S: Final = 600.0
_MODULE: Final = "tega.devices.hand.hand_guard"
_REST_S: Final = 0.2
_TRY_S: Final = 0.5
_CONFIRM_S: Final = 3.0
_POLL_S: Final = 0.02


def guard_hand(bus: Mapping[str, Any], frames: Sequence[CanFrame], *, device_id: int) -> GuardProcess:
    """Start the process that guards a hand, and return it when it is ready."""
    settings = {"bus": bus, "frames": [[f.id, f.data.hex()] for f in frames], "device_id": device_id}
    return GuardProcess("lets go of the hand", _MODULE, json.dumps(settings))


def guard_runs(pid: int) -> bool:
    """Return whether a process that guards a hand runs now; ``False`` where the system does not show it."""
    return is_running(pid, _MODULE)


def take_over(options: AllegroOptions, guard_pid: int) -> tuple[bool, int]:
    """Release a hand after its own process is gone: by its guard if that runs, else by a new one.

    A guard ends when the hand has confirmed, or when it is killed. So the hand is asked once more after its
    end. ``guard_pid`` is 0 for none. Returns whether the hand has confirmed that its motors are off, and the
    process that goes on trying; 0 for none.
    """
    until_s = time.monotonic() + _CONFIRM_S
    while guard_runs(guard_pid):
        if time.monotonic() > until_s:
            return False, guard_pid
        time.sleep(_POLL_S)
    device_id = options.device_id
    try:
        guard = guard_hand(options.can_bus(), off_frames(device_id), device_id=device_id)
    except (DeviceUnavailableError, OSError):
        return False, 0
    guard.beat()
    pid = guard.leave_to_it(confirm_s=_CONFIRM_S)
    return guard.confirmed, pid


class _Hand:
    """The hand, from here."""

    def __init__(self, bus: dict[str, Any], frames: list[list[Any]], device_id: int) -> None:
        self._bus = HandBus(bus, exclusive=False)
        self.label = f"robot hand on {bus_label(bus['interface'], bus['channel'])}"
        self._frames = [CanFrame(can_id, bytes.fromhex(data)) for can_id, data in frames]
        self._device_id = device_id

    def let_go(self, given_up: Callable[[], bool]) -> str:
        """Switch the motors off until the hand confirms or the program goes on; return why it has not confirmed."""
        until_s, why = time.monotonic() + LONGEST_S, "no answer"
        while time.monotonic() < until_s:
            if self._bus.replaced:
                return "its adapter is gone"
            try:
                self._bus.open()
                if self._bus.switch_off(self._frames, device_id=self._device_id, patience_s=_TRY_S):
                    return ""
                why = f"no answer{self._bus.trouble}"
            except Exception as error:  # whatever an adapter's library raises, the hand may push
                why = str(error)
            finally:
                self._bus.drop()
            if given_up():
                return "its program goes on"
            time.sleep(_REST_S)
        return f"{why}, for {LONGEST_S / 60:g} minutes"


def main() -> None:
    """Wait, and let go of the hand if its program ends without a word or stands still."""
    load_can()  # there is no time for that later
    hand = _Hand(**json.loads(sys.argv[1]))
    stand_by(hand.label, hand.let_go)


if __name__ == "__main__":
    main()
