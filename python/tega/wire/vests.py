"""Encode and decode what vests take: a bHaptics vest over Bluetooth LE, and a board of one's own over USB.

Forty intensities, 0 to 100, are always in the wearer's order: front then back, row by row from the top,
columns from the wearer's left to the wearer's right on both panels (``20 * panel + 4 * row + column``). That
is what ``VestFrame.x40()`` gives. Others raise ``ShapeError``, ``DtypeError`` (no integers) or ``WireError`` (out of
range); so does a report or frame of the wrong length, number, version, checksum or field.

No bHaptics vest is a HID device: the 64-byte reports are for this project's own USB bridge or home-made vest, a board
that passes them on, or drives motors itself.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega import _native
from tega.wire.arrays import as_bytes, integer_array


def _forty(intensities: ArrayLike) -> NDArray[np.uint8]:
    if type(intensities) is np.ndarray and intensities.dtype == np.uint8 and intensities.shape == (40,):
        return intensities  # the loop's case: the native side checks the range
    return integer_array("intensities", intensities, np.uint8, (0, 100), ((40,),))


def vest_levels(intensities: ArrayLike) -> NDArray[np.uint8]:
    """Return the levels, 0 to 15, that a vest makes of intensities 0 to 100: ``(15 * i + 50) // 100``.

    Example:
        >>> vest_levels([0, 3, 4, 30, 70, 97]).tolist()
        [0, 0, 1, 5, 11, 15]
    """
    values = integer_array("intensities", intensities, np.uint8, (0, 100))
    return _native.motor_steps(values.ravel()).reshape(values.shape)


def x40_ble_frame(intensities: ArrayLike, *, front_mirror: bool = False) -> bytes:
    """Return the 20 bytes that set all motors of an X40; an X16 understands them too. All zeros is off.

    ``front_mirror`` swaps left and right on the front panel. Its sense on the wire rests on one published table:
    light the front's top left motor and ask the wearer. Intensities of uint8 are not copied.

    Example:
        >>> intensities = np.zeros(40, np.uint8)
        >>> intensities[0] = 100
        >>> x40_ble_frame(intensities)[15]
        15
    """
    return _native.x40_ble_frame(_forty(intensities), front_mirror=front_mirror)


def x40_ble_levels(frame: bytes, *, front_mirror: bool = False) -> NDArray[np.uint8]:
    """Return the (40,) levels, 0 to 15, in a vest frame of 20 bytes, in the wearer's order."""
    return _native.x40_ble_steps(as_bytes(frame), front_mirror=front_mirror)


def x16_levels(frame: bytes, *, front_mirror: bool = False) -> NDArray[np.uint8]:
    """Return the (16,) levels an X16 makes of a vest frame.

    Front upper, front lower, back upper, back lower, each four columns from the wearer's left. An upper motor
    takes the maximum of rows 0 and 1, a lower one of rows 2 to 4.
    """
    return _native.x16_steps(as_bytes(frame), front_mirror=front_mirror)


def hid_motor_report(
    intensities: ArrayLike, *, sequence: int, ttl_ms: int, request_status: bool = False
) -> bytes:
    """Return the output report that sets all motors.

    Args:
        intensities: (40,) or (32,) integers, 0 to 100, in the wearer's order; 32 are two panels of 4 × 4.
        sequence: 0 to 65535, one more each time; the device ignores a repeated number.
        ttl_ms: 1 to 65535: the device goes silent when no further report comes within it.
        request_status: Whether the device is to answer.

    Example:
        >>> hid_motor_report([0] * 40, sequence=1, ttl_ms=150)[:8].hex(" ")
        '01 10 01 00 96 00 00 28'
    """
    values = integer_array("intensities", intensities, np.uint8, (0, 100), ((40,), (32,)))
    return _native.hid_motor_report(values, sequence=sequence, ttl_ms=ttl_ms, request_status=request_status)


def hid_stop_report(*, sequence: int) -> bytes:
    """Return the output report that switches everything off; ``sequence`` is 0 to 65535."""
    return _native.hid_stop_report(sequence=sequence)


@dataclass(frozen=True, slots=True)
class HidMotor:
    """An output report, as the device reads it.

    Attributes:
        intensities: (40,) or (32,) uint8, 0 to 100; None to stop everything.
        ttl_ms: How long they last without a further report; 0 to stop.
        request_status: Whether to answer.
    """

    sequence: int
    intensities: NDArray[np.uint8] | None
    ttl_ms: int
    request_status: bool


def hid_motor(report: bytes) -> HidMotor:
    """Decode an output report, as a device does. Reports outside of the format are refused."""
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
    """Decode an input report of the device."""
    return HidStatus(*_native.hid_status(as_bytes(report)))


def hid_status_report(status: HidStatus) -> bytes:
    """Encode an input report, for a simulated device; ``WireError`` if a number does not fit its field."""
    return _native.hid_status_report(astuple(status))
