"""Bring a tracker's poses to the axes of the robot's base, x forward, y left, z up, smooth them, and take hold of them.

Places in metres and rotations are filtered by the One-Euro filter (Casiez, Roussel, Vogel: CHI 2012). For a sample x
after dt seconds::

    alpha(f)  = 1 / (1 + 1 / (2 π f dt))
    speed    += alpha(speed_cutoff) · ((x - filtered) / dt - speed)
    cutoff    = min_cutoff + beta · |speed|
    filtered += alpha(cutoff) · (x - filtered)

``speed`` is a vector and its length sets one cutoff for all axes, so that the path does not bend. For rotations
the difference x - filtered is the rotation vector log(x filtered⁻¹), and adding is turning on by exp: slerp.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tega.arm.pose import Pose, StampedPose
from tega.arm.rotation import Floats, between, exp, inverse, log_near, multiply, same_side, unit
from tega.arm.settings import FilterSettings, MappingSettings


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


def _share(cutoff_hz: float, dt_s: float) -> float:
    around = 2 * math.pi * cutoff_hz * dt_s
    return around / (1 + around)


class OneEuro:
    """Filters places, or with ``turns`` unit quaternions; each filtered one is on the side of the last.

    ``beta`` is the rise of the cutoff, Hz per m/s; of rotations Hz per rad/s.

    Example:
        >>> OneEuro(1.5, 10, 1).step(np.ones(3), 0.01).tolist()
        [1.0, 1.0, 1.0]
    """

    def __init__(self, cutoff_hz: float, beta: float, speed_cutoff_hz: float, *, turns: bool = False) -> None:
        self._cutoff_hz, self._beta, self._speed_cutoff_hz = cutoff_hz, beta, speed_cutoff_hz
        self._turns = turns
        self._speed: Floats = np.zeros(3)
        self._filtered: Floats | None = None

    def step(self, x: Floats, dt_s: float) -> Floats:
        """Return the filtered sample; ``dt_s`` is the time since the last one, more than 0."""
        last = self._filtered
        if last is None:
            self._filtered = x.copy()
            return self._filtered
        difference = between(last, x) if self._turns else x - last
        self._speed += _share(self._speed_cutoff_hz, dt_s) * (difference / dt_s - self._speed)
        step = _share(self._cutoff_hz + self._beta * math.hypot(*self._speed.tolist()), dt_s) * difference
        self._filtered = same_side(unit(multiply(exp(step), last)), last) if self._turns else last + step
        return self._filtered


class PoseFilter:
    """Filters poses by their own stamps."""

    def __init__(self, settings: FilterSettings) -> None:
        self._s = settings
        self.forget()

    def forget(self) -> None:
        """Reset: the next pose is passed on unfiltered."""
        s = self._s
        self._place = OneEuro(s.cutoff_hz, s.beta_per_m, s.speed_cutoff_hz)
        self._turn = OneEuro(s.turn_cutoff_hz, s.turn_beta_per_rad, s.speed_cutoff_hz, turns=True)
        self._last_ns = 0

    def step(self, t_ns: int, pose: Pose) -> Pose:
        """Return the filtered pose; stamps have to rise."""
        if not self._s.on:
            return pose
        dt_s, self._last_ns = (t_ns - self._last_ns) / 1e9, t_ns
        return Pose(self._place.step(pose.position_m, dt_s), self._turn.step(pose.quaternion_xyzw, dt_s))


class Clutch:
    """Maps the forearm's motion, since the operator took hold, to motion of the target.

    With p0, R0 the forearm's pose and P0, Q0 the target when the operator took hold::

        P = P0 + scale · gain ∘ (p - p0)          Q = exp(gain_turn ∘ log(R R0⁻¹)) Q0

    in the base's axes, so that the first goal is the target itself. The logarithm goes on past half a turn,
    so that an axis that is locked or scaled does not change sides there.
    """

    def __init__(self, settings: MappingSettings) -> None:
        self._gain = settings.scale * np.array(settings.gain_xyz)
        self._gain_turn = np.array(settings.gain_turn)
        self._turn: Floats = np.zeros(3)

    def latch(self, hand: Pose, target: Pose) -> None:
        """Take hold: from now on ``hand`` means ``target``."""
        self._hand_m, self._hand_back = hand.position_m, inverse(hand.quaternion_xyzw)
        self._target_m, self._target_turn = target
        self._turn = np.zeros(3)

    def goal(self, hand: Pose) -> Pose:
        """Return where the target shall go for where the forearm is."""
        self._turn = log_near(multiply(hand.quaternion_xyzw, self._hand_back), self._turn)
        return Pose(
            self._target_m + self._gain * (hand.position_m - self._hand_m),
            unit(multiply(exp(self._gain_turn * self._turn), self._target_turn)),
        )

    def shed(self, goal: Pose, inside: Pose) -> None:
        """Forget how far a goal was outside of the workspace: on the way back the target follows at once."""
        self._target_m = self._target_m + (inside.position_m - goal.position_m)
        if inside.quaternion_xyzw is not goal.quaternion_xyzw:
            back = exp(-self._gain_turn * self._turn)
            self._target_turn = unit(multiply(back, inside.quaternion_xyzw))
