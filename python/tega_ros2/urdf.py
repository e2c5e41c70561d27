"""Describe the hand with its fingertips as a URDF, for ``robot_state_publisher`` and RViz.

Joints have the names of ``/hand/joints``, and the last frame of a finger is the one in which its force is published.
Geometry is that of :mod:`tega.hand.mjcf`: joints as the vendor publishes them, links as cylinders. Masses are left out.
"""

from __future__ import annotations

import math
from typing import Final
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from tega.hand import JOINT_LIMITS_RAD, JOINT_NAMES
from tega.hand.mjcf import NO_LOAD_RAD_S, PAD_RADIUS_M, TORQUE_LIMITS_NM, joint_places
from tega.wire import HAND_FINGERS

PALM: Final = "palm"
_LINK_RADIUS_M: Final = 0.011
_PALM_SIZE_M: Final = (0.0408, 0.113, 0.095)
_PALM_MIDDLE_M: Final = (-0.0093, 0.0, -0.0475)

Vector = NDArray[np.float64]


def hand_urdf() -> str:
    """Return the URDF of the right hand: root ``palm``, 16 joints, and a frame ``FINGER_pad`` on each fingertip.

    Frame ``palm`` is at the base of the middle finger: +x out of the palm, +y towards the index finger, +z towards the
    fingertips. Lengths are in metres, angles in radians, efforts in N·m, speeds in rad/s.
    """
    robot = ET.Element("robot", name="tega_allegro_right")
    palm = ET.SubElement(robot, "link", name=PALM)
    _solid(palm, np.array(_PALM_MIDDLE_M), "0 0 0", "box", size=_numbers(_PALM_SIZE_M))
    bases_m, turns, axes, offsets_m = joint_places()
    for number, finger in enumerate(HAND_FINGERS):
        parent, place_m, rpy = PALM, bases_m[number], _angles(turns[number])
        for joint in range(4):
            name, child = JOINT_NAMES[4 * number + joint], f"{finger}_link{joint}"
            made = _joint(robot, (name, "revolute"), (parent, child), place_m, rpy)
            ET.SubElement(made, "axis", xyz=_numbers(axes[number, joint]))
            low, high = JOINT_LIMITS_RAD[4 * number + joint]
            effort = TORQUE_LIMITS_NM[4 * number + joint]
            limits = {"lower": low, "upper": high, "effort": effort, "velocity": NO_LOAD_RAD_S}
            ET.SubElement(made, "limit", {key: f"{value:.9g}" for key, value in limits.items()})
            place_m, rpy, parent = offsets_m[number, joint], "0 0 0", child
            # The pad's middle lies on the surface of the last link.
            end_m = place_m - np.array([PAD_RADIUS_M if joint == 3 else 0.0, 0.0, 0.0])
            radius_m = PAD_RADIUS_M if joint == 3 else _LINK_RADIUS_M
            length_m = float(np.linalg.norm(end_m))
            link = ET.SubElement(robot, "link", name=child)
            _solid(
                link, end_m / 2, _towards(end_m), "cylinder", radius=f"{radius_m:g}", length=f"{length_m:.9g}"
            )
        _joint(robot, (f"{finger}_pad_joint", "fixed"), (parent, f"{finger}_pad"), place_m, rpy)
        ET.SubElement(robot, "link", name=f"{finger}_pad")
    ET.indent(robot)
    return ET.tostring(robot, encoding="unicode", xml_declaration=True) + "\n"


def _joint(
    robot: ET.Element, kind: tuple[str, str], links: tuple[str, str], place_m: Vector, rpy: str
) -> ET.Element:
    """Add a joint by its name and type, between a parent and its child."""
    joint = ET.SubElement(robot, "joint", name=kind[0], type=kind[1])
    ET.SubElement(joint, "parent", link=links[0])
    ET.SubElement(joint, "child", link=links[1])
    ET.SubElement(joint, "origin", xyz=_numbers(place_m), rpy=rpy)
    return joint


def _solid(link: ET.Element, middle_m: Vector, rpy: str, shape: str, **sizes: str) -> None:
    for use in ("visual", "collision"):
        solid = ET.SubElement(link, use)
        ET.SubElement(solid, "origin", xyz=_numbers(middle_m), rpy=rpy)
        ET.SubElement(ET.SubElement(solid, "geometry"), shape, sizes)


def _angles(turn: Vector) -> str:
    """Return roll, pitch and yaw about the fixed axes x, y, z of a rotation (3, 3)."""
    roll = math.atan2(turn[2, 1], turn[2, 2])
    pitch = math.atan2(-turn[2, 0], math.hypot(turn[2, 1], turn[2, 2]))
    return _numbers((roll, pitch, math.atan2(turn[1, 0], turn[0, 0])))


def _towards(travel_m: Vector) -> str:
    """Return roll, pitch and yaw that turn z into a direction."""
    x, y, z = travel_m / np.linalg.norm(travel_m)
    return _numbers((math.asin(-y), math.atan2(x, z), 0.0))


def _numbers(values: Vector | tuple[float, ...]) -> str:
    return " ".join(f"{value:.9g}" for value in values)
