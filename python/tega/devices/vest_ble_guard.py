"""Silences a Bluetooth vest whose program was killed.

A vest is thought to hold its last frame for ever, and BlueZ keeps the connection of a program that died. So a
second process waits beside the one that drives the vest: ``python -m tega.devices.vest_ble_guard ADDRESS PATH``. A
line on its input ends it. If the input ends without one, the program is gone: the guard takes the connection over,
writes zeros and disconnects. Nothing helps where both are killed, the adapter is pulled out, or the vest is out of
reach.
"""

from __future__ import annotations

import asyncio
import subprocess
import sys
import time
from typing import Any, Final

__all__ = ["MOTORS", "Guard", "main"]

MOTORS: Final = "6e40000a-b5a3-f393-e0a9-e50e24dcca9e"
"""The characteristic that takes motor frames."""

_TRIES: Final = 5
_CALL_S: Final = 5.0
_REST_S: Final = 1.0


class Guard:
    """The guard's process, as seen by the program it watches.

    Args:
        address: The vest's address.
        path: Its path on the system's message bus, where there is one: a connected vest cannot be found by scanning.
    """

    def __init__(self, address: str, path: str) -> None:
        # A session of its own: what is sent to the program's terminal (Ctrl-C, hang-up) is not meant for it.
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tega.devices.vest_ble_guard", address, path],
            stdin=subprocess.PIPE,
            start_new_session=True,
        )

    def dismiss(self) -> None:
        """Tell it that the vest was left silent."""
        try:
            self._process.communicate(b"done\n", timeout=2)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


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
    if sys.stdin.readline():
        return
    for _ in range(_TRIES):
        try:
            asyncio.run(_silence(address, path))
        except (BleakError, OSError, EOFError):
            # A refusal comes at once; out of reach for a moment is not given up.
            time.sleep(_REST_S)
            continue
        return


if __name__ == "__main__":
    main()
