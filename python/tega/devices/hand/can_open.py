"""Open a CAN adapter through python-can; whatever is missing is one sentence, with the next step of its interface."""

from __future__ import annotations

import logging
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple

from tega.errors import DeviceUnavailableError
from tega.runtime.words import nearest_hint

_UP: Final = "ip link set can0 up type can bitrate 1000000 restart-ms 100"
_ANY_CHANNEL: Final = "check that the adapter is plugged in, and its channel"
_NO_MODULE: Final = (ImportError, NameError, NotImplementedError, AttributeError)
_MOST_LETTERS: Final = 200


class _Interface(NamedTuple):
    """Needs of an interface besides python-can (with the verb), how to install them, and its channel."""

    needs: str
    install: str
    channel: str


_INTERFACES: Final[Mapping[str, _Interface]] = {
    "socketcan": _Interface(
        "the kernel's CAN support is",
        "load it: sudo modprobe can_raw",
        f"plug the adapter in and switch its bus on: sudo {_UP}",
    ),
    "kvaser": _Interface(
        "Kvaser's CANlib is",
        "install Kvaser's drivers (on Linux: linuxcan), or use the kernel's driver with interface = 'socketcan'",
        "channel is a number, 0 for the adapter's first",
    ),
    "pcan": _Interface(
        "PEAK's PCAN-Basic is",
        "install PCAN-Basic; on Linux the kernel's driver needs none: interface = 'socketcan', channel = 'can0'",
        "channel is a name such as PCAN_USBBUS1",
    ),
    "ixxat": _Interface(
        "IXXAT's VCI is",
        "install the VCI driver, for Windows alone; on Linux use HMS's kernel driver with interface = 'socketcan'",
        "channel is a number, 0 for the adapter's first",
    ),
    "gs_usb": _Interface(
        "the packages gs_usb and pyusb are",
        "pip install 'python-can[gs-usb]'; on Linux the kernel's driver needs none: interface = 'socketcan'",
        "channel is a number, 0 for the first adapter; bus.index names another",
    ),
    "slcan": _Interface(
        "the package pyserial is",
        "pip install pyserial",
        "channel is the adapter's serial port, such as /dev/ttyACM0 or COM3, and your user may open it",
    ),
    "vector": _Interface(
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
    raise DeviceUnavailableError(
        f"{driver}: interface {interface!r}, channel {_plain(channel)!r} did not open: {text}", hint
    )


def _explained(error: Exception, interface: str, can: Any) -> tuple[str, str]:
    """Return the problem in one sentence, and the next step."""
    known = sorted(can.VALID_INTERFACES)
    if interface not in known:
        return "python-can has no such interface", nearest_hint(interface, known, "it has")
    about = _INTERFACES.get(interface)
    words = " ".join(str(error).split())[:_MOST_LETTERS] or type(error).__name__
    missing = isinstance(error, _NO_MODULE) or (isinstance(error, OSError) and "library" in words.casefold())
    if interface == "socketcan":
        missing = isinstance(error, OSError) and "family not supported" in words
    if about is None:
        if missing:
            return (
                "its library is missing",
                f"install the vendor's driver, and python-can's part for {interface}",
            )
        return words, _ANY_CHANNEL
    return (f"{about.needs} missing", about.install) if missing else (words, about.channel)


def _plain(channel: str | int) -> str | int:
    """Return a channel without a path."""
    return Path(channel).name if isinstance(channel, str) else channel


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
