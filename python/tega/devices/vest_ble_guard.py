"""Silence a Bluetooth vest whose program was killed or stands still.

A vest is thought to hold its last frame for ever, and BlueZ keeps the connection of a program that died. So a second
process waits beside the one that drives the vest (:mod:`tega.devices.guard_process`), and hears from the vest's thread
ten times a second. If its input ends without a word, the program is gone, or could not silence the vest; if it hears
nothing for a second, the program stands still. It then takes the connection over, writes zeros and disconnects, and
tries that for ten minutes, or until a program that stood still goes on, which connects anew. Nothing helps where both
are killed, the adapter is pulled out, or the vest is out of reach.
"""

from __future__ import annotations

import asyncio
import sys
import time
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from tega.devices.guard_process import GuardProcess, stand_by

if TYPE_CHECKING:
    from collections.abc import Callable

MOTORS: Final = "6e40000a-b5a3-f393-e0a9-e50e24dcca9e"
"""The characteristic that takes motor frames."""

LONGEST_S: Final = 600.0
"""For so long it tries, seconds."""

_CALL_S: Final = 5.0
_REST_S: Final = 1.0


def guard_vest(address: str, path: str) -> GuardProcess:
    """Start the process that guards a vest, and return it when it is ready.

    Args:
        address: The vest's address.
        path: Its path on the system's message bus, where there is one: a connected vest cannot be found by scanning.

    Raises:
        DeviceUnavailableError: It does not start.
    """
    return GuardProcess("silences the vest", "tega.devices.vest_ble_guard", address, path)


async def _silence(address: str, path: str) -> None:
    from bleak import BleakClient
    from bleak.backends.device import BLEDevice

    vest: Any = BLEDevice(address, None, {"path": path, "props": {}}) if path else address
    async with asyncio.timeout(_CALL_S), BleakClient(vest) as client:
        await client.write_gatt_char(MOTORS, bytes(20), response=False)


def let_go(address: str, path: str, given_up: Callable[[], bool]) -> None:
    """Silence the vest, or try that until nobody needs it any more."""
    from bleak.exc import BleakError

    until_s = time.monotonic() + LONGEST_S
    while time.monotonic() < until_s:
        try:
            asyncio.run(_silence(address, path))
        except (BleakError, OSError, EOFError, AssertionError):
            # A refusal comes at once; out of reach for a moment is not given up.
            if given_up():
                return
            time.sleep(_REST_S)
            continue
        return


def main() -> None:
    """Wait, and silence the vest if its program ends without a word or stands still."""
    import bleak  # noqa: F401  # there is no time for that later

    stand_by(partial(let_go, sys.argv[1], sys.argv[2]))


if __name__ == "__main__":
    main()
