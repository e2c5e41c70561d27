"""Encode frames and messages for a bHaptics vest.

Forty intensities, 0 to 100, are always in the wearer's order: front then back, row by row from the top,
columns from the wearer's left to the wearer's right on both panels (``20 * panel + 4 * row + column``). That
is what ``VestFrame.x40()`` gives.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

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


def player_v2_message(
    intensities: ArrayLike,
    *,
    duration_ms: int,
    front_key: str | None = "tega_front",
    back_key: str | None = "tega_back",
) -> str:
    """Return the message that makes the vendor's Player (websocket, version 2) play intensities.

    A frame replaces the running one of its key and ends by itself, so a stream with constant keys and a
    duration of 1.5 to 3 periods goes silent when the host does. A panel that is all zero is sent without
    dots, which silences it.

    Args:
        intensities: (40,) integers, 0 to 100, in the wearer's order.
        duration_ms: 20 to 100000.
        front_key: Name of the front panel's frame; None leaves the panel out.
        back_key: Likewise of the back panel.

    Raises:
        ShapeError: Unless there are 40.
        DtypeError: If they are not integers.
        WireError: If one is above 100, if the duration is out of range, or without any key.
    """
    values = _forty(intensities)
    return _native.player_v2_message(values, duration_ms=duration_ms, front_key=front_key, back_key=back_key)


def player_v2_stop(key: str | None = None) -> str:
    """Return the message that ends what one key is playing, or everything.

    Raises:
        WireError: For an empty key.

    Example:
        >>> player_v2_stop()
        '{"Submit":[{"Type":"turnOffAll"}]}'
    """
    return _native.player_v2_stop(key)


def player_v2_ping() -> str:
    """Return a frame without dots, for a foot, which makes the Player send a fresh status."""
    return _native.player_v2_ping()


@dataclass(frozen=True, slots=True)
class PlayerStatus:
    """Status of the Player. It is no acknowledgement that anything moved.

    Attributes:
        connected_devices: How many devices it is connected to.
        connected_positions: Their positions; a vest is "Vest".
        active_keys: Keys that are playing.
        front: Levels of the front panel, usually 20; empty if the message has none.
        back: Likewise of the back panel.
    """

    connected_devices: int
    connected_positions: tuple[str, ...]
    active_keys: tuple[str, ...]
    front: tuple[int, ...]
    back: tuple[int, ...]


def player_v2_status(message: str) -> PlayerStatus:
    """Parse a message of the Player. Fields that are missing, null or unknown do not matter.

    Raises:
        WireError: If the text is not a JSON object, or a known field is of another type.
    """
    devices, positions, keys, front, back = _native.player_v2_status(message)
    return PlayerStatus(devices, tuple(positions), tuple(keys), tuple(front), tuple(back))


def sdk3_dot_message(
    intensities: ArrayLike, *, request_id: int = 1, duration_ms: int = 150, motors: Literal[40, 32] = 40
) -> str:
    """Return the message that makes the vendor's Player (websocket, version 3) play intensities.

    Args:
        intensities: (40,) integers, 0 to 100, in the wearer's order.
        request_id: A number of the caller's.
        duration_ms: 20 to 100000.
        motors: How many values to send. Both are in use, and how the Player tells them apart is not known; 32
            sends rows 0 to 3 of each panel.

    Raises:
        ShapeError: Unless there are 40.
        DtypeError: If they are not integers.
        WireError: If one is above 100, if row 4 is lit and `motors` is 32, or if a number is out of range.
        InvalidValueError: If `motors` is neither.
    """
    values = _forty(intensities)
    return _native.sdk3_dot_message(values, request_id=request_id, duration_ms=duration_ms, motors=motors)


def sdk3_stop_message() -> str:
    """Return the message that ends everything (websocket, version 3)."""
    return _native.sdk3_stop_message()


def hub_line(intensities: ArrayLike, *, request_id: int = 1, duration_ms: int = 150) -> str:
    """Return the line, newline included, that makes a Hub (TCP) play intensities.

    Args:
        intensities: (40,) integers, 0 to 100, in the wearer's order.
        request_id: A number of the caller's.
        duration_ms: 20 to 100000.

    Raises:
        ShapeError: Unless there are 40.
        DtypeError: If they are not integers.
        WireError: If one is above 100, or if a number is out of range.
    """
    return _native.hub_line(_forty(intensities), request_id=request_id, duration_ms=duration_ms)
