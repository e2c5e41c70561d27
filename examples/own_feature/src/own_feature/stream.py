"""Stream the count to another program: lines of text by UDP."""

from __future__ import annotations

import socket
from types import TracebackType
from typing import Self

from own_feature.records import Grip
from tega.records.bus import Backlog, Bus

PORT = 9100


class GripLines:
    """Sends a line for each record of the count; use as a context manager.

    Args:
        bus: The run's.

    Attributes:
        url: Address to which the lines go.
    """

    def __init__(self, bus: Bus) -> None:
        self._bus, self._backlog = bus, Backlog("grip lines", most=100, newest=True)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.url = f"udp://127.0.0.1:{PORT}"

    def __enter__(self) -> Self:
        """Subscribe."""
        self._bus.subscribe(Grip, self._send, name="grip lines", backlog=self._backlog)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Send the waiting lines, and end."""
        self._backlog.close()
        self._socket.close()

    def _send(self, grip: Grip) -> None:
        self._socket.sendto(f"{grip.fingers}\n".encode(), ("127.0.0.1", PORT))
