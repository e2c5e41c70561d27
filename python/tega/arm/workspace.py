"""Limit where the target may be: a box for the place, a cone for the lean of the hand, and near the measured pose."""

from __future__ import annotations

import math

import numpy as np

from tega.arm.pose import Pose
from tega.arm.rotation import Floats, between, cross, exp, multiply, rotate, unit
from tega.arm.settings import LimitSettings

# So much is given for rounding: a nanometre, and a millionth of a degree.
_GIVE_M = 1e-9
_GIVE_RAD = 1e-8


class Workspace:
    """Limits poses to a box for the place and a cone for the lean.

    ``tool_axis``, in the hand's axes, and ``upright``, in the base's, are float64 (3,), unit length.
    """

    def __init__(self, limits: LimitSettings) -> None:
        self._low, self._high = np.array(limits.low_m), np.array(limits.high_m)
        self.tool_axis = np.array(limits.tool_axis) / math.hypot(*limits.tool_axis)
        self.upright = np.array(limits.upright) / math.hypot(*limits.upright)
        self._tilt_rad = limits.tilt_rad

    def holds_place(self, place: Floats) -> bool:
        """Return whether a place is in the box."""
        low, high = self._low - _GIVE_M, self._high + _GIVE_M
        return all(a <= p <= b for a, p, b in zip(low.tolist(), place.tolist(), high.tolist(), strict=True))

    def tilt_rad(self, q: Floats) -> float:
        """Return how far the hand leans."""
        return _angle(rotate(q, self.tool_axis), self.upright)

    def holds_turn(self, q: Floats) -> bool:
        """Return whether a turn is in the cone."""
        return self.tilt_rad(q) <= self._tilt_rad + _GIVE_RAD

    def holds_turning(self, q: Floats, vector: Floats) -> bool:
        """Return whether the whole way from ``q`` by a rotation vector stays in the cone.

        About the unit axis k the height of the tool's axis d over the plane across ``upright`` u is
        a + b cos(φ) + c sin(φ) with a = (u·k)(k·d), b = u·d - a, c = u·(k × d); it is lowest at an end or at
        φ = atan2(c, b) + π.
        """
        if not self.holds_turn(q) or not self.holds_turn(multiply(exp(vector), q)):
            return False
        angle = math.hypot(*vector.tolist())
        if angle < 1e-12:
            return True
        axis, d, u = vector / angle, rotate(q, self.tool_axis), self.upright
        a = float(u @ axis) * float(axis @ d)
        b, c = float(u @ d) - a, float(u @ cross(axis, d))
        lowest = (math.atan2(c, b) + math.pi) % (2 * math.pi)
        return lowest > angle or a - math.hypot(b, c) >= math.cos(self._tilt_rad + _GIVE_RAD)

    def inside(self, pose: Pose) -> Pose:
        """Return the nearest pose inside: cut component by component, and leant back the short way.

        A pose that is already inside is returned as the same object.
        """
        place, q = pose
        if not self.holds_place(place):
            place = np.minimum(np.maximum(place, self._low), self._high)
        if not self.holds_turn(q):
            d = rotate(q, self.tool_axis)
            axis = cross(d, self.upright)
            size = math.hypot(*axis.tolist())
            if size < 1e-9:  # upside down: any way back is as short
                axis = cross(self.upright, np.eye(3)[int(np.argmin(np.abs(self.upright)))])
                size = math.hypot(*axis.tolist())
            q = unit(multiply(exp(axis * ((_angle(d, self.upright) - self._tilt_rad) / size)), q))
        return pose if place is pose.position_m and q is pose.quaternion_xyzw else Pose(place, q)

    def outside(self, pose: Pose) -> str:
        """Return in words how far a pose is outside, ``""`` if it is inside."""
        for axis, low, at, high in zip("xyz", self._low, pose.position_m, self._high, strict=True):
            if at < low - _GIVE_M or at > high + _GIVE_M:
                over = max(low - at, at - high)
                return f"the hand is {1e3 * over:.0f} mm outside of the workspace along {axis}"
        if not self.holds_turn(pose.quaternion_xyzw):
            over = self.tilt_rad(pose.quaternion_xyzw) - self._tilt_rad
            return f"the hand leans {math.degrees(over):.0f}° too far"
        return ""


def _angle(a: Floats, b: Floats) -> float:
    return math.atan2(math.hypot(*cross(a, b).tolist()), float(a @ b))


def clipped(goal: Pose, measured: Pose, limits: LimitSettings) -> Pose:
    """Return the goal, or the pose on the way to it that is as far from the measured hand as allowed.

    The limits are ``ahead_m`` and ``ahead_rad``.
    """
    away = goal.position_m - measured.position_m
    turn = between(measured.quaternion_xyzw, goal.quaternion_xyzw)
    distance, angle = math.hypot(*away.tolist()), math.hypot(*turn.tolist())
    place, q = goal
    if distance > limits.ahead_m:
        place = measured.position_m + away * (limits.ahead_m / distance)
    if angle > limits.ahead_rad:
        q = unit(multiply(exp(turn * (limits.ahead_rad / angle)), measured.quaternion_xyzw))
    return goal if place is goal.position_m and q is goal.quaternion_xyzw else Pose(place, q)
