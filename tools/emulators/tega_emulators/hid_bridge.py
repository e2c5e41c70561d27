"""An emulated microcontroller that implements TEGA's 64-byte USB reports, with a vest that remembers.

There is no USB here: reports travel over a local socket, one packet each, and
:class:`~tega_emulators.hid_port.HidPort`
stands for hidapi at the other end. Written from the table of the report format. A report that breaks it is refused and
counted, as the firmware has to.

Faults: ``close`` (unplugged: closes the connection and is not found any more), ``freeze`` (takes nothing, says nothing,
motors run out by their time to live), ``slow`` (takes a report in 150 ms), ``garbage`` (its reports have a wrong
checksum), ``wrong-version`` (it sends version 2), ``refuse`` (is there, does not open), ``no-vest`` (has no link to a
vest).
"""

from __future__ import annotations

import argparse
import asyncio
import socket
import struct
import time
import zlib
from pathlib import Path
from typing import Any, ClassVar

from tega_emulators import vest_process
from tega_emulators.vest_process import Motors

_STATUS_S = 0.1
_SLOW_S = 0.15


class Bridge:
    """The board and its vest."""

    faults: ClassVar[tuple[str, ...]] = (
        "close",
        "freeze",
        "slow",
        "garbage",
        "wrong-version",
        "refuse",
        "no-vest",
    )

    def __init__(self, folder: Path) -> None:
        self.motors = Motors()
        self.errors: list[str] = []
        self.received = 0
        self.connections = 0
        self._path = folder / "hid_bridge.socket"
        self._listener: socket.socket | None = None
        self._client: socket.socket | None = None
        self._fault = ""
        self._sequence = 0
        self._until_s = 0.0
        self._refused = 0
        self._born_s = time.monotonic()
        self._tasks: list[asyncio.Task[None]] = []

    async def start(self) -> dict[str, Any]:
        """Be plugged in."""
        self._plug_in()
        self._tasks = [asyncio.create_task(self._run()), asyncio.create_task(self._time_out())]
        return {"path": str(self._path)}

    async def fault(self, name: str) -> None:
        """Switch a fault on."""
        if name in {"close", "refuse"}:
            self._unplug()
        if name != "close" and self._listener is None:
            self._plug_in()
        self._fault = name

    def _plug_in(self) -> None:
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._listener.settimeout(0)
        self._listener.bind(str(self._path))
        self._listener.listen(1)

    def _unplug(self) -> None:
        if self._client is not None:
            self._client.close()
        if self._listener is not None:
            self._listener.close()
        self._path.unlink(missing_ok=True)
        self._client = self._listener = None

    async def _run(self) -> None:
        while True:
            await asyncio.sleep(0.001)
            if self._fault == "freeze":
                continue
            if self._client is None and self._listener is not None:
                self._accept(self._listener)
            if self._client is not None:
                await self._take(self._client)

    def _accept(self, listener: socket.socket) -> None:
        try:
            client, _ = listener.accept()
        except BlockingIOError:
            return
        if self._fault == "refuse":
            client.close()
            return
        client.settimeout(0)
        self._client = client
        self.connections += 1

    async def _take(self, client: socket.socket) -> None:
        try:
            report = client.recv(256)
        except BlockingIOError:
            return
        except OSError:
            report = b""
        if not report:
            client.close()
            self._client = None
            return
        if self._fault == "slow":
            await asyncio.sleep(_SLOW_S)
        self.received += 1
        try:
            wants_status = self._obey(report)
        except ValueError as error:
            self._refused += 1
            self.errors.append(str(error))
            return
        if wants_status:
            self._say()

    def _obey(self, report: bytes) -> bool:
        """Do what a report asks for; return whether it wants an answer."""
        if len(report) != 64:
            raise ValueError(f"{len(report)} bytes")
        number, head, sequence, ttl_ms, layout, count = struct.unpack_from("<BBHHBB", report)
        (checksum,) = struct.unpack_from("<I", report, 60)
        if checksum != zlib.crc32(report[:60]):
            raise ValueError("checksum")
        if number != 1 or head >> 4 != 1 or head & 0b1100:
            raise ValueError(f"report {number}, version and flags {head:#04x}")
        if (layout, count) not in {(0, 40), (1, 32)}:
            raise ValueError(f"layout {layout} with {count} motors")
        if any(report[8 + count : 60]):
            raise ValueError("bytes behind the levels are not 0")
        if head & 1:
            self._sequence = sequence
            self.motors.set([0] * 40)
            return bool(head & 2)
        levels = list(report[8 : 8 + count])
        if max(levels) > 100:
            raise ValueError(f"level {max(levels)}")
        if ttl_ms == 0:
            raise ValueError("no time to live")
        if sequence != self._sequence:
            self._sequence = sequence
            self._until_s = time.monotonic() + ttl_ms / 1000
            if layout == 1:
                levels = [*levels[:16], 0, 0, 0, 0, *levels[16:], 0, 0, 0, 0]
            self.motors.set(levels)
        return bool(head & 2)

    def _say(self) -> None:
        if self._client is None:
            return
        version = 2 if self._fault == "wrong-version" else 1
        link = 0 if self._fault == "no-vest" else 2
        uptime_ms = int((time.monotonic() - self._born_s) * 1000)
        body = struct.pack(
            "<BBHBBHII", 2, version << 4, self._sequence, link, 77, 0, uptime_ms, self._refused
        )
        body = body.ljust(60, b"\0")
        checksum = zlib.crc32(body) ^ (0xFFFF if self._fault == "garbage" else 0)
        try:
            self._client.send(body + struct.pack("<I", checksum))
        except OSError:
            return  # the other end reads too slowly or has gone, as on USB

    async def _time_out(self) -> None:
        """Let the levels lapse, whatever else is frozen, and send the status now and then."""
        said_s = 0.0
        while True:
            await asyncio.sleep(0.005)
            now = time.monotonic()
            if now > self._until_s:
                self.motors.set([0] * 40)
            if self._fault != "freeze" and now - said_s >= _STATUS_S:
                said_s = now
                self._say()


def main() -> None:
    """Run it until standard input ends."""
    parser = argparse.ArgumentParser(description="An emulated USB board with TEGA's reports.")
    parser.add_argument("folder", type=Path, help="where to put its socket")
    asyncio.run(vest_process.serve(Bridge(parser.parse_args().folder)))


if __name__ == "__main__":
    main()
