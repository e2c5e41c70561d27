"""Silence a Bluetooth vest whose program was killed.

A vest is thought to hold its last frame for ever, and BlueZ keeps the connection of a program that died. So a second
process waits beside the one that drives the vest (:mod:`tega.devices.guard_process`). If its input ends without a word,
the program is gone, or could not silence the vest: it takes the connection over, writes zeros and disconnects, and
tries that for ten minutes. Nothing helps where both are killed, the adapter is pulled out, or the vest is out of reach.
"""

from __future__ import annotations

import asyncio
import sys
import time
from typing import Any, Final

from tega.devices.guard_process import GuardProcess, answer, say_ready, stay_alone

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


def main() -> None:
    """Wait, and silence the vest if the program ends without a word."""
    from bleak.exc import BleakError

    address, path = sys.argv[1], sys.argv[2]
    say_ready()
    while line := sys.stdin.buffer.readline():
        if b"done" in line:
            return
        answer(line)
    stay_alone()
    until_s = time.monotonic() + LONGEST_S
    while time.monotonic() < until_s:
        try:
            asyncio.run(_silence(address, path))
        except (BleakError, OSError, EOFError, AssertionError):
            # A refusal comes at once; out of reach for a moment is not given up.
            time.sleep(_REST_S)
            continue
        return


if __name__ == "__main__":
    main()
