"""Open live EMG sources on a serial port, and read and write their bytes."""

from __future__ import annotations

from typing import Annotated, ClassVar

import msgspec

from tega.devices.emg.live_emg import LiveEmg, LiveEmgOptions
from tega.devices.serial_port import SerialPort
from tega.errors import DeviceUnavailableError

BaudRate = Annotated[int, msgspec.Meta(ge=300, le=4_000_000)]
"""Bits per second."""


class LiveSerialOptions(LiveEmgOptions, frozen=True, kw_only=True):
    """Settings that all sources on a serial port have.

    Attributes:
        port: The port's name, such as ``/dev/ttyUSB0``, ``/dev/serial/by-id/…`` or ``COM3``.
    """

    port: str


class LiveSerialEmg(LiveEmg):
    """A live EMG source on a serial port; a driver adds its commands and decoding."""

    extra: ClassVar[str] = "lab"
    requires: ClassVar[tuple[str, ...]] = ("serial",)
    stop_command: ClassVar[bytes] = b""

    def __init__(self, options: LiveSerialOptions) -> None:
        super().__init__(options)
        self._port_name = options.port
        self._port: SerialPort | None = None
        self._n_bytes = 0

    def _connect(self, baud: int) -> SerialPort:
        """Open the port."""
        self._port, self._n_bytes = SerialPort(self._port_name, baud, driver=self.name), 0
        return self._port

    def _received(self) -> tuple[bytes, int]:
        """Return the bytes that have arrived and when the last of them did."""
        data, arrival_ns = (b"", 0) if self._port is None else self._port.arrived()
        self._n_bytes += len(data)
        return data, arrival_ns

    def _stop(self) -> None:
        if self._port is None:
            return
        try:
            if self.stop_command:
                self._port.write(self.stop_command)
        except DeviceUnavailableError:
            pass  # unplugged: there is nothing left to stop
        finally:
            self._port.close()
            self._port = None

    def _label(self) -> str:
        return self._port_name.replace("\\", "/").rsplit("/", 1)[-1]

    def _own_notes(self) -> tuple[str, ...]:
        port = self._port  # another thread may close it meanwhile
        return () if port is None else port.notes
