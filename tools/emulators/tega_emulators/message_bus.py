"""A private D-Bus message bus: ``dbus-daemon`` has to be installed; Linux only."""

from __future__ import annotations

import asyncio
import tempfile
from pathlib import Path

__all__ = ["PrivateBus"]


class PrivateBus:
    """A message bus of its own, for emulated system services.

    A client that is to use it has its ``address`` as ``DBUS_SYSTEM_BUS_ADDRESS``.
    """

    def __init__(self) -> None:
        self.address = ""
        self._folder = tempfile.TemporaryDirectory(prefix="bus")
        self._daemon: asyncio.subprocess.Process | None = None

    async def start(self) -> str:
        """Start the bus and return its address."""
        self._daemon = await asyncio.create_subprocess_exec(
            "dbus-daemon",
            "--session",
            "--nofork",
            "--nopidfile",
            f"--address=unix:path={Path(self._folder.name) / 'bus'}",
            "--print-address",
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.DEVNULL,
        )
        if self._daemon.stdout is None:
            raise OSError("dbus-daemon has no output")
        self.address = (await self._daemon.stdout.readline()).decode().strip()
        return self.address

    def stop(self) -> None:
        """End the bus."""
        if self._daemon is not None:
            self._daemon.terminate()
        self._folder.cleanup()
