"""Stands for the package hidapi and carries its reports to an emulated board over a local socket.

It has the calls that TEGA's drivers make, with hidapi's arguments, answers and failures. What it does not show is
the operating system's part: permissions, the report descriptor, a hub that loses packets.
"""

from __future__ import annotations

import contextlib
import socket
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import AbstractContextManager
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Any, NamedTuple

__all__ = ["HidBoard", "HidPort", "installed"]

_NAMES = ("hid", "hidraw")


class HidBoard(NamedTuple):
    """One interface of a device, as hidapi enumerates it.

    ``path`` is its socket; ``usage`` is its usage page and usage, zeros where the system does not report
    them.
    """

    path: str
    vendor_id: int = 0x1209
    product_id: int = 0x0001
    serial: str = "EMULATED"
    usage: tuple[int, int] = (0, 0)


class HidPort:
    """A module-like object with some boards; each is there as long as its socket is.

    A path instead of a board is the socket of one with the numbers of TEGA's own. ``can_open`` allows opening
    them, as a udev rule would; ``n_opened`` counts openings of each socket.
    """

    def __init__(self, *boards: HidBoard | str, can_open: bool = True) -> None:
        # What stands in sys.modules is asked for its specification.
        self.__spec__ = ModuleSpec(_NAMES[0], None)
        self.boards = [HidBoard(board) if isinstance(board, str) else board for board in boards]
        self.can_open = can_open
        self.n_opened: Counter[str] = Counter()

    def enumerate(self, vendor_id: int = 0, product_id: int = 0) -> list[dict[str, Any]]:
        """List the boards that are plugged in and asked for; 0 asks for any."""
        return [
            {
                "path": board.path.encode(),
                "vendor_id": board.vendor_id,
                "product_id": board.product_id,
                "serial_number": board.serial,
                "usage_page": board.usage[0],
                "usage": board.usage[1],
            }
            for board in self.boards
            if vendor_id in {0, board.vendor_id}
            and product_id in {0, board.product_id}
            and Path(board.path).exists()
        ]

    def device(self) -> _Device:
        """Return a device that is not open."""
        return _Device(self)

    def installed(self) -> AbstractContextManager[None]:
        """Stand in the place of the package as long as a block lasts."""
        return installed(self, *_NAMES)


@contextlib.contextmanager
def installed(module: Any, *names: str) -> Iterator[None]:
    """Have something module-like stand in the place of packages as long as the block lasts."""
    before = {name: sys.modules.get(name) for name in names}
    sys.modules.update(dict.fromkeys(names, module))
    try:
        yield
    finally:
        for name, found in before.items():
            if found is None:
                del sys.modules[name]
            else:
                sys.modules[name] = found


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
        self._port.n_opened[path.decode()] += 1

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
