"""Keep a goal near the measured pose, so that a spring never pulls harder than at that distance."""

from __future__ import annotations

import math

from tega.arm.pose import Pose
from tega.arm.rotation import between, exp, multiply, unit
from tega.arm.settings import LimitSettings


def clipped(goal: Pose, measured: Pose, limits: LimitSettings) -> Pose:
    """Return the goal, or the pose on the way to it that is as far from the measured one as is allowed.

    Args:
        goal: Pose to move to.
        measured: Where the hand is.
        limits: ``ahead_m`` and ``ahead_rad``.
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
