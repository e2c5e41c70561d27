"""Encode and decode the frames that a bHaptics vest takes over Bluetooth LE.

Forty intensities, 0 to 100, are always in the wearer's order: front then back, row by row from the top,
columns from the wearer's left to the wearer's right on both panels (``20 * panel + 4 * row + column``). That
is what ``VestFrame.x40()`` gives.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega import _native
from tega.wire.arrays import as_bytes, integer_array


def _forty(intensities: ArrayLike) -> NDArray[np.uint8]:
    if isinstance(intensities, np.ndarray) and intensities.dtype == np.uint8 and intensities.shape == (40,):
        return intensities  # the loop's case: the native side checks the range
    return integer_array("intensities", intensities, np.uint8, (0, 100), ((40,),))


def vest_levels(intensities: ArrayLike) -> NDArray[np.uint8]:
    """Return the levels, 0 to 15, that a vest makes of intensities 0 to 100: ``(15 * i + 50) // 100``.

    Args:
        intensities: (n,) integers, 0 to 100.

    Raises:
        DtypeError: If they are not integers.
        WireError: If one is above 100.

    Example:
        >>> vest_levels([0, 3, 4, 30, 70, 97]).tolist()
        [0, 0, 1, 5, 11, 15]
    """
    values = integer_array("intensities", intensities, np.uint8, (0, 100))
    return _native.motor_steps(values.ravel()).reshape(values.shape)


def x40_ble_frame(intensities: ArrayLike, *, front_mirror: bool = False) -> bytes:
    """Return the 20 bytes that set all motors of an X40; an X16 understands them too. All zeros is off.

    Args:
        intensities: (40,) integers, 0 to 100, in the wearer's order; uint8 is not copied.
        front_mirror: Swap left and right on the front panel. Its sense on the wire rests on one published
            table: light the front's top left motor and ask the wearer.

    Raises:
        ShapeError: Unless there are 40.
        DtypeError: If they are not integers.
        WireError: If one is above 100.

    Example:
        >>> intensities = np.zeros(40, np.uint8)
        >>> intensities[0] = 100
        >>> x40_ble_frame(intensities)[15]
        15
    """
    return _native.x40_ble_frame(_forty(intensities), front_mirror=front_mirror)


def x40_ble_levels(frame: bytes, *, front_mirror: bool = False) -> NDArray[np.uint8]:
    """Return the (40,) levels, 0 to 15, in a vest frame, in the wearer's order.

    Raises:
        WireError: Unless the frame has 20 bytes.
    """
    return _native.x40_ble_steps(as_bytes(frame), front_mirror=front_mirror)


def x16_levels(frame: bytes, *, front_mirror: bool = False) -> NDArray[np.uint8]:
    """Return the (16,) levels an X16 makes of a vest frame.

    Front upper, front lower, back upper, back lower, each four columns from the wearer's left. An upper motor
    takes the maximum of rows 0 and 1, a lower one of rows 2 to 4.

    Raises:
        WireError: Unless the frame has 20 bytes.
    """
    return _native.x16_steps(as_bytes(frame), front_mirror=front_mirror)
