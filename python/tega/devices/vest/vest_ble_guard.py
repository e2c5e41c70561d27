"""Silence a Bluetooth vest if its program was killed or hangs.

A vest is believed to hold its last frame forever, and BlueZ keeps the connection of a program that died. So a second
process waits beside the one that drives the vest (:mod:`tega.devices.hand.guard_process`), and receives a message
from the vest's thread ten times a second. If its input ends without notice, the program is gone, or could not silence
the vest; if no message comes for a second, the program hangs. The guard then takes the connection over, writes zeros
and disconnects. It tries that for ten minutes, or until a program that hung continues and reconnects. Nothing helps
if both are killed, the adapter is pulled out, or the vest is out of reach.
"""

from __future__ import annotations

import asyncio
import sys
import time
from collections.abc import Callable
from functools import partial
from typing import Any, Final

from tega.devices.at_exit import last_words
from tega.devices.hand.guard_process import GuardProcess, stand_by
from tega.runtime.child_process import is_running

MOTORS: Final = "6e40000a-b5a3-f393-e0a9-e50e24dcca9e"
"""The characteristic that takes motor frames."""

_LONGEST_S: Final = 600.0  # for so long it tries

_MODULE: Final = "tega.devices.vest.vest_ble_guard"
_CALL_S: Final = 5.0
_REST_S: Final = 1.0


class VestWatch:
    """Keeps what outlives a link to a vest: the process that silences it, and whether it is silent.

    ``guard`` is ``None`` before the first link. ``silent``: zeros were the last that the vest is known to
    have taken, and nothing was sent since. ``confirmed``: the vest itself has answered behind those zeros.
    """

    def __init__(self) -> None:
        self.guard: GuardProcess | None = None
        self.silent = True
        self.confirmed = False
        self._of = ("", "")

    def over(self, address: str, path: str) -> None:
        """Have a process watch over a vest; ``path`` is its path on the system's message bus, if any.

        Scanning does not find a connected vest.
        """
        if self.guard is not None and self._of != (address, path):
            self.end()
        if self.guard is None:
            self.guard = GuardProcess("silences the vest", _MODULE, address, path)
            self._of, self.silent = (address, path), True
            self.beat()  # until it has received something it takes the vest for silent

    def beat(self) -> None:
        """Report to the process that the program is alive."""
        if self.guard is not None:
            self.guard.beat()

    def end(self) -> None:
        """Dismiss the process if the vest is known to be silent; else leave the vest to it, and say so."""
        guard, self.guard = self.guard, None
        if guard is None:
            return
        if self.silent:
            guard.dismiss()
            return
        pid = guard.leave_to_it()
        if guard.confirmed:
            return
        tries = "no other process goes on silencing it"
        if is_running(pid, _MODULE):
            tries = f"process {pid} goes on silencing it, for {_LONGEST_S / 60:g} minutes"
        last_words(
            f"USE THE VEST'S SWITCH: {self._of[0]}: it has not confirmed that its motors rest, so it may still be "
            f"vibrating; {tries}"
        )


async def _silence(address: str, path: str) -> None:
    from bleak import BleakClient
    from bleak.backends.device import BLEDevice

    vest: Any = BLEDevice(address, None, {"path": path, "props": {}}) if path else address
    async with asyncio.timeout(_CALL_S), BleakClient(vest) as client:
        await client.write_gatt_char(MOTORS, bytes(20), response=False)


def let_go(address: str, path: str, given_up: Callable[[], bool]) -> str:
    """Silence the vest, or try until its program goes on; return why it has not taken the zeros."""
    until_s, why = time.monotonic() + _LONGEST_S, ""
    while time.monotonic() < until_s:
        try:
            asyncio.run(_silence(address, path))
        except Exception as error:  # whatever the library raises, the vest may vibrate
            # A refusal comes at once; out of reach for a moment is not given up.
            why = f"{type(error).__name__}: {error}"
            if given_up():
                return "its program goes on"
            time.sleep(_REST_S)
            continue
        return ""
    return f"{why}, for {_LONGEST_S / 60:g} minutes"


def main() -> None:
    """Wait, and silence the vest if its program ends without a word or stands still."""
    import bleak  # noqa: F401  # there is no time for that later

    stand_by(f"vest {sys.argv[1]}", partial(let_go, sys.argv[1], sys.argv[2]))


if __name__ == "__main__":
    main()
