"""Find serial ports of EMG amplifiers, read and write them without waiting, and open live sources on them.

On Linux a native thread drains the port and stamps arriving bytes, so that neither waits for the interpreter lock;
elsewhere the reading thread does that.
"""

from __future__ import annotations

import errno
import os
import sys
import time
from pathlib import Path
from typing import Annotated, Any, ClassVar

import msgspec

from tega import _native
from tega.devices.base import Found
from tega.devices.emg.live_emg import POLL_S, LiveEmg, LiveEmgOptions
from tega.errors import DeviceUnavailableError
from tega.runtime.lifecycle import require
from tega.runtime.threads import run_realtime

_WRITE_TIMEOUT_S = 0.5


class SerialPort:
    """An open port, 8 data bits, no parity, one stop bit.

    ``port`` is such as ``/dev/ttyUSB0``, ``/dev/serial/by-id/…`` or ``COM3``; ``baud`` is bits per second;
    ``driver`` names the driver in messages. ``DeviceUnavailableError``: the port is not there, in use, not
    allowed, or cannot be set up.
    """

    def __init__(self, port: str, baud: int, *, driver: str) -> None:
        self.name = Path(port).name
        self.notes: tuple[str, ...] = ()
        self._driver = driver
        serial: Any = require("serial", driver=driver, extra="lab")
        try:
            self._port: Any = serial.Serial(
                port, baud, timeout=0, write_timeout=_WRITE_TIMEOUT_S, exclusive=True
            )
        except (OSError, ValueError) as error:
            raise DeviceUnavailableError(
                f"{driver}: port {port} did not open: {error}", _hint(error)
            ) from error
        if "ttyUSB" in port or "FTDI" in port:
            try:
                self._port.set_low_latency_mode(True)
            except (OSError, ValueError, NotImplementedError, AttributeError):
                self.notes = (
                    f"{self.name}: low-latency mode could not be set, so samples may come 16 ms late; "
                    "write 1 to the adapter's latency_timer",
                )
        if sys.platform == "linux":
            try:
                with run_realtime("hand", inherited=True):  # it holds no lock that anybody waits for
                    self._drain = _native.SerialDrain(self._port.fileno())
            except OSError as error:
                self._port.close()
                raise DeviceUnavailableError(
                    f"{driver}: port {port} cannot be drained: {error}",
                    "end some of the programs that are running",
                ) from error

    def arrived(self) -> tuple[bytes, int]:
        """Return the bytes since the last call, without waiting, and the arrival time of the last.

        The time is in ns of the monotonic clock; ignore it if there are no bytes.
        """
        try:
            if sys.platform == "linux":
                return self._drain.take()
            n = self._port.in_waiting
            return bytes(self._port.read(n)) if n else b"", time.monotonic_ns()
        except (OSError, TypeError, AttributeError) as error:
            raise self._gone(error) from error

    def read(self) -> bytes:
        """Return the bytes that have arrived, without waiting; raises the same as :meth:`arrived`."""
        return self.arrived()[0]

    def write(self, data: bytes) -> None:
        """Send bytes; ``DeviceUnavailableError`` if the port is gone, or accepts nothing."""
        try:
            self._port.write(data)
        except OSError as error:
            raise self._gone(error) from error

    def read_until(self, end: bytes, timeout_s: float) -> bytes:
        """Return the bytes up to and including ``end``, or all bytes until the timeout."""
        data, deadline = b"", time.monotonic() + timeout_s
        while end not in data and time.monotonic() < deadline:
            got = self.read()
            data += got
            if not got:
                time.sleep(POLL_S)
        return data

    def drain(self, quiet_s: float, timeout_s: float) -> None:
        """Throw away what arrives until nothing did for ``quiet_s``."""
        quiet_from = time.monotonic()
        deadline = quiet_from + timeout_s
        while time.monotonic() < deadline and time.monotonic() - quiet_from < quiet_s:
            if self.read():
                quiet_from = time.monotonic()
            else:
                time.sleep(POLL_S)

    def close(self) -> None:
        """Close the port; one that is gone already is closed as well."""
        if sys.platform == "linux":
            self._drain.close()
        try:
            self._port.close()
        except OSError:
            return

    def _gone(self, error: BaseException) -> DeviceUnavailableError:
        return DeviceUnavailableError(
            f"{self._driver}: {self.name} was lost: {error}", "was it unplugged? plug it in and start again"
        )


def _hint(error: BaseException) -> str:
    number, text = getattr(error, "errno", None), str(error)
    if number == errno.EACCES or "Permission" in text:
        return "your user may not open it: join the group that owns it (often dialout) and log in again"
    if number in {errno.EBUSY, errno.EAGAIN} or "lock" in text or "Access is denied" in text:
        return "another program has it open: close that one (a serial monitor, ModemManager)"
    from serial.tools import list_ports

    there = ", ".join(sorted(p.device for p in list_ports.comports() if p.hwid != "n/a"))
    return f"ports that are there: {there}" if there else "no USB serial port is there: check cable and power"


# Adapters and boards by USB vendor. None of these numbers says which program runs on the board.
_BOARDS = {
    0x0403: "FTDI adapter",
    0x10C4: "CP210x adapter",
    0x1A86: "CH340 adapter",
    0x16C0: "Teensy",
    0x2341: "Arduino",
    0x2A03: "Arduino",
    0x239A: "Adafruit board",
    0x2E8A: "Raspberry Pi Pico",
    0x303A: "ESP32",
}
# An FT231X adapter.
_DONGLE = (0x0403, 0x6015)
_BY_ID = Path("/dev/serial/by-id")


def find_boards(driver: str, *, dongles: bool) -> list[Found]:
    """List a driver's ports: those with the adapters that a Cyton's dongle has, or all others."""
    list_ports = require("serial.tools.list_ports", driver=driver, extra="lab")
    # Names that stay when ports are plugged in another order.
    lasting = {link.resolve(): str(link) for link in sorted(_BY_ID.glob("*"), reverse=True)}
    found = []
    for info in list_ports.comports():
        if info.vid is None or ((info.vid, info.pid or 0) == _DONGLE) is not dongles:
            continue
        board = info.product or _BOARDS.get(info.vid, f"USB {info.vid:04x}:{info.pid or 0:04x}")
        problem = hint = ""
        if os.name == "posix" and not os.access(info.device, os.R_OK | os.W_OK):
            problem = f"your user may not open {info.device}"
            hint = "join the group that owns it (sudo usermod -aG dialout $USER) and log in again"
        found.append(
            Found(
                driver=driver,
                label=f"{info.device} ({board}{f', {info.serial_number}' if info.serial_number else ''})",
                options={"port": lasting.get(Path(info.device).resolve(), info.device)},
                problem=problem,
                hint=hint,
                note="its firmware cannot be detected from outside",
                may_open=False,
            )
        )
    return found


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
        self._waiting = b""  # received before the decoder was there
        self._n_bytes = 0

    def _connect(self, baud: int) -> SerialPort:
        self._port, self._n_bytes = SerialPort(self._options.port, baud, driver=self.name), 0
        return self._port

    def _received(self) -> tuple[bytes, int]:
        data, arrival_ns = (b"", 0) if self._port is None else self._port.arrived()
        self._n_bytes += len(data)
        data, self._waiting = self._waiting + data, b""
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
