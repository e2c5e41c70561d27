"""Stands for the package hidapi and carries its reports to an emulated board over a local socket.

It has the calls that TEGA's drivers make, with hidapi's arguments, answers and failures. What it does not show is
the operating system's part: permissions, the report descriptor, a hub that loses packets.
"""

from __future__ import annotations

import contextlib
import socket
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

__all__ = ["HidPort"]

_NAMES = ("hid", "hidraw")


class HidPort:
    """A module-like object with one board, if its socket is there.

    Args:
        path: The board's socket.
        vendor_id: What it is enumerated as.
        product_id: Likewise.
        serial: Likewise.
        can_open: Whether opening it is allowed, as a udev rule would.
    """

    def __init__(
        self,
        path: str,
        *,
        vendor_id: int = 0x1209,
        product_id: int = 0x0001,
        serial: str = "EMULATED",
        can_open: bool = True,
    ) -> None:
        self._path = path
        self._numbers = (vendor_id, product_id)
        self._serial = serial
        self.can_open = can_open

    def enumerate(self, vendor_id: int = 0, product_id: int = 0) -> list[dict[str, Any]]:
        """List the board if it is plugged in and asked for; 0 asks for any."""
        asked = zip((vendor_id, product_id), self._numbers, strict=True)
        if not Path(self._path).exists() or any(a not in {0, n} for a, n in asked):
            return []
        return [
            {
                "path": self._path.encode(),
                "vendor_id": self._numbers[0],
                "product_id": self._numbers[1],
                "serial_number": self._serial,
            }
        ]

    def device(self) -> _Device:
        """Return a device that is not open."""
        return _Device(self)

    @contextlib.contextmanager
    def installed(self) -> Iterator[None]:
        """Stand in the place of the package as long as the block lasts."""
        before = {name: sys.modules.get(name) for name in _NAMES}
        sys.modules.update(dict.fromkeys(_NAMES, self))  # type: ignore[arg-type]  # module-like is enough
        try:
            yield
        finally:
            for name, module in before.items():
                if module is None:
                    del sys.modules[name]
                else:
                    sys.modules[name] = module


class _Device:
    def __init__(self, port: HidPort) -> None:
        self._port = port
        self._socket: socket.socket | None = None

    def open_path(self, path: bytes) -> None:
        channel = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            channel.connect(path.decode() if self._port.can_open else "")
        except OSError:
            channel.close()
            raise OSError("open failed") from None
        channel.settimeout(0)
        self._socket = channel

    def set_nonblocking(self, _on: int) -> int:
        return 0

    def write(self, report: bytes) -> int:
        try:
            return self._opened().send(report)
        except OSError:
            return -1

    def read(self, max_length: int, timeout_ms: int = 0) -> list[int]:
        channel = self._opened()
        channel.settimeout(timeout_ms / 1000)
        try:
            report = channel.recv(max_length)
        except (BlockingIOError, TimeoutError):
            return []
        if not report:
            raise OSError("read error")
        return list(report)

    def error(self) -> str:
        return "no such device"

    def close(self) -> None:
        channel, self._socket = self._socket, None
        if channel is not None:
            channel.close()

    def _opened(self) -> socket.socket:
        if self._socket is None:
            raise ValueError("not open")
        return self._socket
