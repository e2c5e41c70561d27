"""Open live EMG sources on a serial port, and read and write their bytes."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

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
    """A live EMG source on a serial port; a driver adds its commands and a decoder.

    ``stop_command`` ends the stream. ``pieces`` names the kind of whole pieces in the stream by the name of
    the decoder's count of them.
    """

    extra: ClassVar[str] = "lab"
    requires: ClassVar[tuple[str, ...]] = ("serial",)
    stop_command: ClassVar[bytes] = b""
    pieces: ClassVar[str] = "packets"
    _options: LiveSerialOptions

    def __init__(self, options: LiveSerialOptions) -> None:
        super().__init__(options, options.port.replace("\\", "/").rsplit("/", 1)[-1])
        self._port: SerialPort | None = None
        self._decoder: Any = None
        self._n_bytes = 0

    def _connect(self, baud: int) -> SerialPort:
        """Open the port."""
        self._port, self._n_bytes = SerialPort(self._options.port, baud, driver=self.name), 0
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

    def _own_notes(self) -> tuple[str, ...]:
        port = self._port  # another thread may close it meanwhile
        if port is None or self._decoder is None:
            return ()
        return port.notes + self._losses()

    def _losses(self) -> tuple[str, ...]:
        """Return a note on what the decoder could not use."""
        n = self._decoder.skipped_bytes
        return (f"{n} bytes belonged to no packet",) if n else ()

    def _instead(self) -> str:
        if not self._n_bytes:
            return ""
        n = getattr(self._decoder, self.pieces)
        return f"since it was opened {self._n_bytes} bytes came, {n} {self.pieces} among them"
