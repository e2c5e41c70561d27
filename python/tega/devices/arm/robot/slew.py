"""Limit the speed of the arm's target, whatever is asked: the last stage before the arm."""

from __future__ import annotations

import math

import numpy as np

from tega.arm.messages import Quaternion, Triple
from tega.arm.rotation import between, exp, multiply, unit


class Slew:
    """Moves a target towards the requested pose, along the straight line and the shortest rotation.

    Args:
        speed_m_s: Maximum speed.
        turn_rad_s: Maximum angular speed.
        place: Where it begins.
        turn: Initial rotation.
    """

    def __init__(self, speed_m_s: float, turn_rad_s: float, place: Triple, turn: Quaternion) -> None:
        self._speed_m_s, self._turn_rad_s = speed_m_s, turn_rad_s
        self.place, self.turn = place, turn

    def toward(self, place: Triple, turn: Quaternion, dt_s: float) -> bool:
        """Go on for a time; return whether it is there."""
        route, left = np.subtract(place, self.place), self._speed_m_s * dt_s
        length = math.hypot(*route.tolist())
        arc = between(unit(np.array(self.turn)), unit(np.array(turn)))
        angle, left_rad = math.hypot(*arc.tolist()), self._turn_rad_s * dt_s
        there = length <= left and angle <= left_rad
        new = np.array(place) if length <= left else np.array(self.place) + route * (left / length)
        q = (
            np.array(turn)
            if angle <= left_rad
            else multiply(exp(arc * (left_rad / angle)), np.array(self.turn))
        )
        x, y, z = new.tolist()
        qx, qy, qz, qw = unit(q).tolist()
        self.place, self.turn = (x, y, z), (qx, qy, qz, qw)
        return there
