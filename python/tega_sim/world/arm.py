"""Describe the 7-joint Panda arm, which carries the hand, as an MJCF fragment.

Kinematics and limits are the maker's published ones. Link masses are rounded identified values; the arm is
compensated for gravity and for the hand it carries, as the real one is, and is as stiff as its joint controller.
"""

from __future__ import annotations

from typing import Final

import numpy as np

ARM_LIMITS_RAD: Final = np.array(
    [
        [-2.8973, 2.8973],
        [-1.7628, 1.7628],
        [-2.8973, 2.8973],
        [-3.0718, -0.0698],
        [-2.8973, 2.8973],
        [-0.0175, 3.7525],
        [-2.8973, 2.8973],
    ]
)
"""Lowest and highest joint angle, float64 (7, 2)."""

ARM_SPEEDS_RAD_S: Final = np.array([2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61])
"""Highest joint speed, float64 (7,)."""

ARM_POSTURE_RAD: Final = np.array([-0.471, 0.298, 0.06, -1.872, 1.315, 1.243, -1.42])
"""Joint angles with the hand about the object, float64 (7,); the follower stays near them where it may."""

# a, d, alpha of the modified Denavit-Hartenberg rows; mass; capsule from, to in the link's frame.
_HALF_PI: Final = np.pi / 2
_ROWS: Final = (
    (0.0, 0.333, 0.0, 4.97, "0 0 -0.15 0 0 0"),
    (0.0, 0.0, -_HALF_PI, 0.65, "0 -0.1 0 0 0 0"),
    (0.0, 0.316, _HALF_PI, 3.23, "0 0 -0.1 0.08 0 0"),
    (0.0825, 0.0, _HALF_PI, 3.59, "0 0 0 -0.08 0.1 0"),
    (-0.0825, 0.384, -_HALF_PI, 1.23, "0 0.03 -0.25 0 0.05 -0.05"),
    (0.0, 0.0, _HALF_PI, 1.67, "0 0 0 0.08 0 0"),
    (0.088, 0.0, _HALF_PI, 0.74, "0 0 0.02 0 0 0.07"),
)
_FLANGE_M: Final = 0.107
# Where the arm stands (x, y, z, turned about z) and how the hand is bolted on, with the object at the origin: found
# by a search for what keeps all joints 0.6 rad from their limits wherever the hand may be led.
_BASE: Final = (-0.05, 0.40, -0.2, -_HALF_PI)
_TWIST_RAD: Final = -3 * np.pi / 4
_TORQUES_NM: Final = (87, 87, 87, 87, 12, 12, 12)
_STIFFNESS_NM: Final = (12000, 12000, 12000, 12000, 4000, 4000, 4000)


def arm_joint_names() -> list[str]:
    """Return the seven joints' names in the model."""
    return [f"arm{joint}" for joint in range(1, 8)]


def arm_body(inside: str) -> str:
    """Return the arm's bodies, with ``inside`` bolted to the flange."""
    x, y, z, yaw = _BASE
    text = f'<body name="arm0" pos="{x} {y} {z}" quat="{np.cos(yaw / 2)} 0 0 {np.sin(yaw / 2)}">'
    text += '<geom class="still" type="capsule" size="0.06" fromto="0 0 0 0 0 0.15" mass="3"/>'
    for number, (a, d, alpha, mass, ends) in enumerate(_ROWS, start=1):
        place = f"{a} {-d * np.sin(alpha)} {d * np.cos(alpha)}"
        low, high = ARM_LIMITS_RAD[number - 1]
        text += (
            f'<body name="arm{number}" pos="{place}" quat="{np.cos(alpha / 2)} {np.sin(alpha / 2)} 0 0" gravcomp="1">'
            f'<joint name="arm{number}" axis="0 0 1" range="{low} {high}" limited="true" armature="0.1" damping="1"/>'
            f'<geom class="still" type="capsule" size="0.05" fromto="{ends}" mass="{mass}" rgba="0.62 0.56 0.78 1"/>'
        )
    half = _TWIST_RAD / 2
    text += (
        f'<body name="flange" pos="0 0 {_FLANGE_M}" quat="{np.cos(half)} 0 0 {np.sin(half)}">{inside}</body>'
    )
    return text + "</body>" * 8


def arm_actuators() -> str:
    """Return one servo a joint, within the arm's torque: its input is the speed at which the set angle moves."""
    return "".join(
        f'<intvelocity name="{name}" joint="{name}" kp="{stiffness}" dampratio="1" '
        f'actrange="{low} {high}" forcerange="{-torque} {torque}"/>'
        for name, stiffness, torque, (low, high) in zip(
            arm_joint_names(), _STIFFNESS_NM, _TORQUES_NM, ARM_LIMITS_RAD, strict=True
        )
    )
