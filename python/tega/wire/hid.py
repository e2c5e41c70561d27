"""Encode and decode the 64-byte reports of this project's own USB bridge or home-made vest.

No bHaptics vest is a HID device: these reports are for a board that passes them on, or drives motors itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega import _native
from tega.wire.arrays import as_bytes, integer_array


def hid_motor_report(
    intensities: ArrayLike, *, sequence: int, ttl_ms: int, request_status: bool = False
) -> bytes:
    """Return the output report that sets all motors.

    Args:
        intensities: (40,) or (32,) integers, 0 to 100, in the wearer's order; 32 are two panels of 4 × 4.
        sequence: 0 to 65535, one more each time; the device ignores a repeated number.
        ttl_ms: 1 to 65535: the device goes silent when no further report comes within it.
        request_status: Whether the device is to answer.

    Raises:
        ShapeError: Unless there are 40 or 32.
        DtypeError: If they are not integers.
        WireError: If one is above 100, or if a number is out of range.

    Example:
        >>> hid_motor_report([0] * 40, sequence=1, ttl_ms=150)[:8].hex(" ")
        '01 10 01 00 96 00 00 28'
    """
    values = integer_array("intensities", intensities, np.uint8, (0, 100), ((40,), (32,)))
    return _native.hid_motor_report(values, sequence=sequence, ttl_ms=ttl_ms, request_status=request_status)


def hid_stop_report(*, sequence: int) -> bytes:
    """Return the output report that switches everything off.

    Raises:
        WireError: If the sequence number is outside 0 to 65535.
    """
    return _native.hid_stop_report(sequence=sequence)


@dataclass(frozen=True, slots=True)
class HidMotor:
    """An output report, as the device reads it.

    Attributes:
        sequence: Its number.
        intensities: (40,) or (32,) uint8, 0 to 100; None to stop everything.
        ttl_ms: How long they last without a further report; 0 to stop.
        request_status: Whether to answer.
    """

    sequence: int
    intensities: NDArray[np.uint8] | None
    ttl_ms: int
    request_status: bool


def hid_motor(report: bytes) -> HidMotor:
    """Decode an output report, as a device does. Reports outside of the format are refused.

    Raises:
        WireError: For the wrong length, number, version, checksum or field.
    """
    sequence, levels = _native.hid_motor(as_bytes(report))
    if levels is None:
        return HidMotor(sequence, None, 0, request_status=False)
    intensities, ttl_ms, request_status = levels
    return HidMotor(sequence, intensities, ttl_ms, request_status)


@dataclass(frozen=True, slots=True)
class HidStatus:
    """Status of the device, from the device.

    Attributes:
        sequence: Number of the last report it saw.
        link: Its link to the vest: 0 none, 1 scanning, 2 connected.
        battery: The vest's, percent; None if not known.
        faults: Fault bits.
        uptime_ms: Time since it started.
        dropped: Reports it refused.
    """

    sequence: int
    link: int
    battery: int | None
    faults: int
    uptime_ms: int
    dropped: int


def hid_status(report: bytes) -> HidStatus:
    """Decode an input report of the device.

    Raises:
        WireError: For the wrong length, number, version or checksum, or a link state the format does not
            have.
    """
    return HidStatus(*_native.hid_status(as_bytes(report)))


def hid_status_report(status: HidStatus) -> bytes:
    """Encode an input report, for a simulated device.

    Raises:
        WireError: If a number does not fit its field.
    """
    fields = (status.sequence, status.link, status.battery, status.faults, status.uptime_ms, status.dropped)
    return _native.hid_status_report(fields)
