"""Map motion of the forearm to a goal for the hand, both counted from where the operator took hold."""

from __future__ import annotations

import numpy as np

from tega.arm.pose import Pose
from tega.arm.rotation import Floats, exp, inverse, log_near, multiply, unit
from tega.arm.settings import MappingSettings


class Clutch:
    """Maps the forearm's motion, since the operator took hold, to motion of the target.

    With p0, R0 the forearm's pose and P0, Q0 the target when the operator took hold::

        P = P0 + scale · gain ∘ (p - p0)          Q = exp(gain_turn ∘ log(R R0⁻¹)) Q0

    in the base's axes, so that the first goal is the target itself. The logarithm goes on past half a turn, so
    that an axis that is locked or scaled does not change sides there.
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
