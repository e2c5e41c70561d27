"""Convert poses from a tracker's axes to those of the robot's base: x forward, y left, z up."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tega.arm.pose import Pose, StampedPose
from tega.arm.rotation import unit
from tega.arm.settings import MappingSettings


def _rows(*rows: tuple[int, int, int]) -> NDArray[np.float64]:
    matrix = np.array(rows, np.float64)
    matrix.setflags(write=False)
    return matrix


FRAMES: Final[Mapping[str, NDArray[np.float64]]] = MappingProxyType(
    {
        "base": _rows((1, 0, 0), (0, 1, 0), (0, 0, 1)),
        # Right-handed, y up, -z forward: OpenXR, SteamVR, HoloLens, and NatNet with y up.
        "openxr": _rows((0, 0, -1), (-1, 0, 0), (0, 1, 0)),
        # Left-handed, y up, z forward: the only one with determinant -1.
        "unity": _rows((0, 0, 1), (-1, 0, 0), (0, 1, 0)),
        # Right-handed, z up, x forward: ROS; Vicon too, once its millimetres are metres.
        "ros": _rows((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    }
)
"""Matrices from the axes of trackers to the base's, float64 (3, 3)."""

MIRROR: Final = _rows((1, 0, 0), (0, -1, 0), (0, 0, 1))
"""Left and right exchanged."""


def turned(yaw_rad: float) -> NDArray[np.float64]:
    """Return the turn by an angle about the vertical, float64 (3, 3)."""
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


class ToBase:
    """Changes the axes of poses: p' = M p and R' = M R Mᵀ, with ``matrix`` M, float64 (3, 3).

    M is the frame's matrix, then the turn that brings the operator's heading to x, then the mirror where it
    is asked for (left and right are the operator's), then the turn from the operator's axes to those of the
    base. As a quaternion R' is (det(M) M v, w): a matrix that mirrors turns the sense of rotation as well.
    """

    def __init__(self, settings: MappingSettings) -> None:
        s = settings
        matrix = turned(-s.yaw_rad) @ FRAMES[s.frame]
        self.matrix: NDArray[np.float64] = turned(-s.base_yaw_rad) @ (
            MIRROR @ matrix if s.mirrored else matrix
        )
        self._turn = self.matrix * round(float(np.linalg.det(self.matrix)))

    def __call__(self, pose: StampedPose) -> Pose:
        """Return a pose in the base's axes; its quaternion gets unit length."""
        q = unit(np.asarray(pose.quaternion_xyzw, np.float64))
        return Pose(
            self.matrix @ np.asarray(pose.position_m, np.float64), np.append(self._turn @ q[:3], q[3])
        )
