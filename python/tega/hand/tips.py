"""Compute the positions of an Allegro hand's fingertips relative to its palm from its joint angles.

Forward kinematics by the vendor's published geometry, that of :mod:`tega.hand.mjcf`: each joint rotates the rest of
the chain about an axis, and the next joint lies at an offset from it.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega.hand.mjcf import joint_places
from tega.haptics import FINGERS
from tega.wire import HAND_FINGERS

# By finger in the hand's order: the first joint's frame, each joint's axis as a cross product, and where what comes
# after each joint lies.
_BASES_M, _TURNS, _AXES, _OFFSETS_M = joint_places()
_CROSS: Final = np.zeros((4, 4, 3, 3))
_CROSS[..., [2, 0, 1], [1, 2, 0]], _CROSS[..., [1, 2, 0], [2, 0, 1]] = _AXES, -_AXES
_SQUARE: Final = _CROSS @ _CROSS
_THUMB_FIRST: Final = [HAND_FINGERS.index(finger) for finger in FINGERS]


def fingertips_m(angles_rad: ArrayLike) -> NDArray[np.float64]:
    """Return the middle of each fingertip's pad in the palm's frame.

    Args:
        angles_rad: (16,), in the order of :data:`tega.hand.motion.JOINT_NAMES`.

    Returns:
        float64 (4, 3), metres, thumb first: out of the palm, towards the index finger, towards the fingertips. Of a
        hand that holds something upright the second is the height over the palm.

    Raises:
        ValueError: There are not 16 angles.

    Example:
        >>> fingertips_m([0.0] * 16).round(3)[2].tolist()
        [0.012, 0.0, 0.126]
    """
    angles = np.asarray(angles_rad, np.float64).reshape(4, 4, 1, 1)
    # Rodrigues: R = 1 + sin(angle) [axis]× + (1 - cos(angle)) [axis]×².
    turned = np.eye(3) + np.sin(angles) * _CROSS + (1 - np.cos(angles)) * _SQUARE
    place, turn = _BASES_M, _TURNS
    for joint in range(4):
        turn = turn @ turned[:, joint]
        place = place + (turn @ _OFFSETS_M[:, joint, :, None])[..., 0]
    found: NDArray[np.float64] = place[_THUMB_FIRST]
    return found


def tip_heights_mm(angles_rad: ArrayLike) -> tuple[float, ...]:
    """Return the height of each fingertip over the palm, thumb first, of a hand that holds something upright.

    Angles and errors are those of :func:`fingertips_m`.
    """
    heights: list[float] = (1e3 * fingertips_m(angles_rad)[:, 1]).tolist()
    return tuple(heights)
