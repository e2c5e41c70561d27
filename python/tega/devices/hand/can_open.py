"""Open a CAN adapter through python-can; whatever is missing is one sentence, with the next step of its interface.

A serial adapter (SLCAN) is read in whole pieces and written without waiting. python-can reads it byte by byte, with
three system calls for each, and waits another millisecond when it is asked whether there is more: a hand that reports
every 3 ms kept a third of a core busy, and with it the interpreter. It also blocks until the adapter has taken each
frame, without a limit if the adapter hangs. Only that differs here; the lines have python-can's meaning in both
directions.
"""

from __future__ import annotations

import logging
import os
import re
import select
import sys
import time
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, Final

from tega.errors import DeviceUnavailableError
from tega.runtime.lifecycle import require
from tega.runtime.words import nearest_hint

_UP: Final = "ip link set can0 up type can bitrate 1000000 restart-ms 100"
_NO_MODULE: Final = (ImportError, NameError, NotImplementedError, AttributeError)
_MOST_LETTERS: Final = 200


# Needs of an interface besides python-can (with the verb), how to install them, and its channel.
_INTERFACES: Final[Mapping[str, tuple[str, str, str]]] = {
    "socketcan": (
        "the kernel's CAN support is",
        "load it: sudo modprobe can_raw",
        f"plug the adapter in and switch its bus on: sudo {_UP}",
    ),
    "kvaser": (
        "Kvaser's CANlib is",
        "install Kvaser's drivers (on Linux: linuxcan), or use the kernel's driver with interface = 'socketcan'",
        "channel is a number, 0 for the adapter's first",
    ),
    "pcan": (
        "PEAK's PCAN-Basic is",
        "install PCAN-Basic; on Linux the kernel's driver needs none: interface = 'socketcan', channel = 'can0'",
        "channel is a name such as PCAN_USBBUS1",
    ),
    "ixxat": (
        "IXXAT's VCI is",
        "install the VCI driver, for Windows alone; on Linux use HMS's kernel driver with interface = 'socketcan'",
        "channel is a number, 0 for the adapter's first",
    ),
    "gs_usb": (
        "the packages gs_usb and pyusb are",
        "pip install 'python-can[gs-usb]'; on Linux the kernel's driver needs none: interface = 'socketcan'",
        "channel is a number, 0 for the first adapter; bus.index names another",
    ),
    "slcan": (
        "the package pyserial is",
        "pip install pyserial",
        "channel is the adapter's serial port, such as /dev/ttyACM0 or COM3, and your user may open it",
    ),
    "vector": (
        "Vector's XL driver library is",
        "install it, for Windows alone; on Linux use interface = 'socketcan'",
        "channel is a number, 0 for the adapter's first",
    ),
}


def open_can_bus(
    driver: str, interface: str, make: Callable[[], Any], *, can: Any, channel: str | int
) -> Any:
    """Open a bus; ``DeviceUnavailableError`` where its adapter is missing, refuses, or lacks a package."""
    with _quiet():
        try:
            return make()
        except Exception as error:  # adapters raise what they like, NameError where their library is missing
            text, hint = _explained(error, interface, can)
            # A half-made bus says so when it is forgotten: that is now.
            traceback.clear_frames(error.__traceback__)
            error.__traceback__ = error.__context__ = error.__cause__ = None
    name = Path(channel).name if isinstance(channel, str) else channel
    raise DeviceUnavailableError(
        f"{driver}: interface {interface!r}, channel {name!r} did not open: {text}", hint
    )


def _explained(error: Exception, interface: str, can: Any) -> tuple[str, str]:
    """Return the problem in one sentence, and the next step."""
    known = sorted(can.VALID_INTERFACES)
    if interface not in known:
        return "python-can has no such interface", nearest_hint(interface, known, "it has")
    needs, install, channel = _INTERFACES.get(interface) or (
        "its library is",
        f"install the vendor's driver, and python-can's part for {interface}",
        "check that the adapter is plugged in, and its channel",
    )
    words = " ".join(str(error).split())[:_MOST_LETTERS] or type(error).__name__
    missing = isinstance(error, _NO_MODULE) or (isinstance(error, OSError) and "library" in words.casefold())
    if interface == "socketcan":
        missing = isinstance(error, OSError) and "family not supported" in words
    if "exclusively lock" in words:
        return "another program uses it", "end that program first, such as a run or tega-teleop hand"
    return (f"{needs} missing", install) if missing else (words, channel)


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep python-can's own words, and those of buses that were never whole, from being printed."""
    log, hook = logging.getLogger("can"), sys.unraisablehook
    level = log.level
    log.setLevel(logging.CRITICAL + 1)
    sys.unraisablehook = lambda _reported: None
    try:
        yield
    finally:
        log.setLevel(level)
        sys.unraisablehook = hook


_PIECE_BYTES = 4096
_LINE = re.compile(rb"[^\r\a]*[\r\a]")  # an answer, a refusal
_LONGEST_BYTES = 64  # twice a frame's; what goes on for longer without an end is noise
_DONE = frozenset({b"\r", b"z\r", b"Z\r"})  # what it says to every frame that it was given


@cache
def slcan_bus(*, exclusive: bool) -> Any:
    """Return a subclass of python-can's slcan bus, or that bus itself where a port cannot be waited for.

    ``exclusive``: it is refused while another program has it so; the system gives it back when a program ends.
    """
    base: Any = require("can.interfaces.slcan", driver="slcan", extra="lab").slcanBus
    error_check: Any = require("can.exceptions", driver="slcan", extra="lab").error_check
    if os.name != "posix":
        return base

    class SlcanBus(base):  # type: ignore[misc]  # python-can is imported when it is needed
        _kept: list[str] | None = None

        def set_bitrate(self, *rates_bit_s: Any) -> None:
            """Lock the port before the first word, which closes the adapter under a program that has it."""
            self.serialPortOrig.exclusive = exclusive or None
            super().set_bitrate(*rates_bit_s)

        def send_together(self, messages: Iterable[Any], timeout: float) -> None:
            """Send messages in one piece, so that neither end is woken for each; raises what ``send`` does."""
            kept: list[str] = []
            self._kept = kept
            try:
                for message in messages:
                    self.send(message, timeout=timeout)
            finally:
                self._kept = None
            self._write(self.LINE_TERMINATOR.decode().join(kept))

        def _read(self, timeout: float | None) -> str | None:
            """Return the next line, or ``None`` when none is complete in time."""
            buffer: bytearray = self._buffer
            until_s = None if timeout is None else time.monotonic() + timeout
            while True:
                while (line := _LINE.match(buffer)) is not None:
                    answer = line[0]
                    del buffer[: len(answer)]
                    if answer not in _DONE:
                        return answer.decode()
                if len(buffer) > _LONGEST_BYTES:
                    n_bytes = len(buffer)
                    buffer.clear()
                    raise ValueError(f"{n_bytes} bytes came without the end of a line")
                left_s = None if until_s is None else max(0.0, until_s - time.monotonic())
                port = self.serialPortOrig.fileno()
                if not select.select([port], [], [], left_s)[0]:
                    return None
                piece = os.read(port, _PIECE_BYTES)
                if not piece:
                    raise OSError("the serial adapter is gone")
                buffer += piece

        def _write(self, string: str) -> None:
            """Hand a line to the system; wait for the part that it does not take at once."""
            if self._kept is not None:
                self._kept.append(string)
                return
            data = string.encode() + self.LINE_TERMINATOR
            port = self.serialPortOrig
            with error_check("Could not write to serial device"):
                n_taken = 0
                with suppress(BlockingIOError):
                    n_taken = os.write(port.fileno(), data)
                if n_taken < len(data):
                    port.write(data[n_taken:])

    return SlcanBus
