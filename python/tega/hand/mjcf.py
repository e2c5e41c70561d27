"""Describe the Allegro right hand with a DIGIT pad on each fingertip, as an MJCF fragment, and place its fingertips.

Kinematics, masses and limits are the vendor's published ones; links are capsules. Frame ``palm``: at the base of
the middle finger, +x out of the palm, +y towards the index finger, +z towards the fingertips. Joints are in the
order of :data:`tega.hand.motion.JOINT_NAMES`. Forward kinematics: each joint rotates the rest of the chain about an
axis, and the next joint lies at an offset from it.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega.hand.motion import JOINT_LIMITS_RAD, TORQUE_LIMITS
from tega.haptics import FINGERS
from tega.wire import HAND_FINGERS

FULL_DUTY_NM: Final = 1.0
"""Torque of a joint at full motor duty, N·m. Nominal: the value in the vendor's drivers. The older hand's data sheet
gives 0.7 at 7.5 V; version 4 runs at 12 V. No source measures it."""

TORQUE_LIMITS_NM: Final = TORQUE_LIMITS * FULL_DUTY_NM
"""The vendor's limits of each joint, N·m, float64 (16,)."""

MOUNT_M: Final = 0.095 + 0.015
"""Flange to ``palm`` along the hand's axis: the hand's base, and an adapter of assumed thickness."""

PAD_RADIUS_M: Final = 0.012
"""Radius of the fingertip's rounding across the finger; along it the pad is straight."""

PAD_HALF_LENGTH_M: Final = 0.010
"""Half of that straight part."""

# Speed of a joint at full duty without load, rad/s, as of tega.hand.motion.JointModel; reached with a time constant of
# 0.07 s.
_DAMPING: Final = FULL_DUTY_NM / 9.52
_ARMATURE: Final = 0.07 * _DAMPING
_STOP_MARGIN_RAD: Final = 0.1
_LINK_RADIUS_M: Final = 0.011
_SHORT_M: Final = 0.03

# name: base position, base rotation (quaternion of the published roll, pitch, yaw)
_BASES: Final = {
    "index": ("0 0.0435 -0.001542", "0.99904822 -0.04361939 0 0"),
    "middle": ("0 0 0.0007", "1 0 0 0"),
    "ring": ("0 -0.0435 -0.001542", "0.99904822 0.04361939 0 0"),
    "thumb": ("-0.0182 0.019333 -0.045987", "0.47771442 -0.52133381 -0.52133381 -0.47771442"),
}
# length of a link along z, mass, next joint's place
_FINGER_LINKS: Final = ((0.0164, 0.0119), (0.0540, 0.0650), (0.0384, 0.0355), (0.0267, 0.0096 + 0.0168))
_THUMB_LINKS: Final = ((0.0455, 0.0176), (0.0177, 0.0119), (0.0514, 0.0380), (0.0423, 0.0388 + 0.0168))
_FINGER_AXES: Final = ("0 0 1", "0 1 0", "0 1 0", "0 1 0")
_THUMB_AXES: Final = ("-1 0 0", "0 0 1", "0 1 0", "0 1 0")
_THUMB_SECOND: Final = "-0.027 0.005 0.0399"


def joint_names() -> list[str]:
    """Return the 16 joints' names in the model, in the hand's order."""
    return [f"{finger}{joint}" for finger in HAND_FINGERS for joint in range(4)]


def _joint_places() -> list[NDArray[np.float64]]:
    """Return place and rotation of each finger's first joint, the joints' axes, and the way from each to the next."""
    bases_m, turns, axes, offsets_m = [], [], [], []
    for name in HAND_FINGERS:
        thumb = name == "thumb"
        links, around = (_THUMB_LINKS, _THUMB_AXES) if thumb else (_FINGER_LINKS, _FINGER_AXES)
        ways = [np.array([0.0, 0.0, length]) for length, _mass in links]
        if thumb:
            ways[0] = _numbers(_THUMB_SECOND)
        ways[3] += [PAD_RADIUS_M, 0.0, -PAD_HALF_LENGTH_M]
        place, turn = (_numbers(text) for text in _BASES[name])
        w, *axis = turn.tolist()
        cross = np.cross(np.eye(3), axis)
        bases_m.append(place)
        turns.append(np.eye(3) + 2 * w * cross + 2 * cross @ cross)
        axes.append([_numbers(text) for text in around])
        offsets_m.append(ways)
    return [np.array(one) for one in (bases_m, turns, axes, offsets_m)]


def _numbers(text: str) -> NDArray[np.float64]:
    return np.array([float(word) for word in text.split()])


def _finger(number: int, name: str) -> str:
    thumb = name == "thumb"
    links, axes = (_THUMB_LINKS, _THUMB_AXES) if thumb else (_FINGER_LINKS, _FINGER_AXES)
    text, close = "", ""
    for joint, ((length, mass), axis) in enumerate(zip(links, axes, strict=True)):
        if joint == 0:
            pos, quat = _BASES[name]
        elif thumb and joint == 1:
            pos, quat = _THUMB_SECOND, "1 0 0 0"
        else:
            pos, quat = f"0 0 {links[joint - 1][0]}", "1 0 0 0"
        low, high = JOINT_LIMITS_RAD[4 * number + joint]
        # The printed limits lie that far inside the stops.
        text += (
            f'<body name="{name}_link{joint}" pos="{pos}" quat="{quat}">'
            f'<joint name="{name}{joint}" axis="{axis}" range="{low - _STOP_MARGIN_RAD} {high + _STOP_MARGIN_RAD}" '
            f'limited="true" damping="{_DAMPING}" armature="{_ARMATURE}"/>'
        )
        geom = f'<geom name="{name}_geom{joint}" type="capsule" mass="{mass}"'
        if thumb and joint == 0:
            text += f'{geom} class="still" size="0.015" fromto="-0.018 0.005 0 -0.018 0.005 0.03"/>'
        elif joint == 3:
            middle = length - PAD_HALF_LENGTH_M
            text += (
                f'<geom name="{name}_pad" class="finger{number}" type="capsule" mass="{mass}" '
                f'size="{PAD_RADIUS_M} {PAD_HALF_LENGTH_M}" pos="0 0 {middle}" rgba="0.95 0.95 0.92 1"/>'
                f'<site name="{name}_pad" pos="{PAD_RADIUS_M} 0 {middle}"/>'
            )
        else:
            # The shortest links lie between longer ones and need no contacts of their own.
            touching, shorter = ("still", 0.0) if length < _SHORT_M else (f"finger{number}", 0.005)
            text += f'{geom} class="{touching}" size="{_LINK_RADIUS_M} {length / 2 - shorter}" pos="0 0 {length / 2}"/>'
        close += "</body>"
    return text + close


def hand_body() -> str:
    """Return the hand's bodies, to stand inside the flange's."""
    fingers = "".join(_finger(number, name) for number, name in enumerate(HAND_FINGERS))
    return (
        f'<body name="palm" pos="0 0 {MOUNT_M}">'
        '<geom name="palm" class="palm" type="box" size="0.0204 0.0565 0.0475" pos="-0.0093 0 -0.0475" mass="0.4154"/>'
        '<site name="palm"/>'
        f"{fingers}</body>"
    )


def hand_actuators() -> str:
    """Return one torque motor a joint, limited as the vendor's driver does."""
    return "".join(
        f'<motor name="{name}" joint="{name}" ctrlrange="{-limit} {limit}" ctrllimited="true"/>'
        for name, limit in zip(joint_names(), TORQUE_LIMITS_NM, strict=True)
    )


# By finger in the hand's order: the first joint's frame, each joint's axis as a cross product, and where what comes
# after each joint lies.
_BASES_M, _TURNS, _AXES, _OFFSETS_M = _joint_places()
_CROSS: Final = np.zeros((4, 4, 3, 3))
_CROSS[..., [2, 0, 1], [1, 2, 0]], _CROSS[..., [1, 2, 0], [2, 0, 1]] = _AXES, -_AXES
_SQUARE: Final = _CROSS @ _CROSS
_THUMB_FIRST: Final = [HAND_FINGERS.index(finger) for finger in FINGERS]


def fingertips_m(angles_rad: ArrayLike) -> NDArray[np.float64]:
    """Return the middle of each fingertip's pad in the palm's frame, of 16 joint angles, else ``ValueError``.

    The result is float64 (4, 3), metres, thumb first: out of the palm, towards the index finger, towards the
    fingertips. Of a hand that holds something upright the second is the height over the palm.

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
