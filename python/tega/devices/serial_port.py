"""Read and write a serial port without waiting, and explain its errors in plain words.

On Linux a native thread drains the port and stamps arriving bytes, so that neither waits for the interpreter lock;
elsewhere the reading thread does that.
"""

from __future__ import annotations

import errno
import sys
import time
from pathlib import Path
from typing import Any

from tega import _native
from tega.errors import DeviceUnavailableError
from tega.runtime.lifecycle import require
from tega.runtime.threads import run_realtime

POLL_S = 0.004
"""How often a port is looked at while waiting: one period of a 250 Hz board."""

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

    def drain(self, quiet_s: float, timeout_s: float) -> int:
        """Throw away what arrives until nothing did for ``quiet_s``; return how many bytes that were."""
        n, deadline = 0, time.monotonic() + timeout_s
        quiet_from = time.monotonic()
        while time.monotonic() < deadline and time.monotonic() - quiet_from < quiet_s:
            got = len(self.read())
            if got:
                n, quiet_from = n + got, time.monotonic()
            else:
                time.sleep(POLL_S)
        return n

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
    """Return the fix for a port that did not open."""
    number, text = getattr(error, "errno", None), str(error)
    if number == errno.EACCES or "Permission" in text:
        return "your user may not open it: join the group that owns it (often dialout) and log in again"
    if number in {errno.EBUSY, errno.EAGAIN} or "lock" in text or "Access is denied" in text:
        return "another program has it open: close that one (a serial monitor, ModemManager)"
    from serial.tools import list_ports

    there = ", ".join(sorted(p.device for p in list_ports.comports() if p.hwid != "n/a"))
    return f"ports that are there: {there}" if there else "no USB serial port is there: check cable and power"
