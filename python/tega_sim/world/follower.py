"""Lead the hand where the forearm goes: limited motion, then inverse kinematics for the arm's joints."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tega_sim.world.arm import ARM_LIMITS_RAD, ARM_POSTURE_RAD, ARM_SPEEDS_RAD_S

if TYPE_CHECKING:
    from numpy.typing import NDArray


_SPEED_M_S: Final = 0.25
_ACCELERATION_M_S2: Final = 1.0
_TURN_RAD_S: Final = 1.0
_DAMPED: Final = 1e-4 * np.eye(6)
_POSTURE_PULL: Final = 0.02
_LOWEST_RAD, _HIGHEST_RAD = ARM_LIMITS_RAD.T.copy()


class ArmFollower:
    """Moves the place where the palm shall be towards its target, and finds joint angles for it.

    The place moves at most 0.25 m/s and 1 m/s², and turns at most 1 rad/s. The joints follow by one damped
    least-squares step a tick, near a posture where the arm has room, within their limits of angle and speed.
    ``palm_m``, float64 (3,), world frame, and ``rotation``, float64 (3, 3), palm to world, are the palm's at
    first.
    """

    def __init__(
        self, mujoco: Any, model: Any, palm_m: NDArray[np.float64], rotation: NDArray[np.float64]
    ) -> None:
        self._mujoco, self._model = mujoco, model
        self._plan = mujoco.MjData(model)
        self._site = model.site("palm").id
        self._plan.qpos[:7] = ARM_POSTURE_RAD
        self._place, self._velocity, self._rotation = palm_m.copy(), np.zeros(3), rotation.copy()
        self._target, self._target_rotation = palm_m.copy(), rotation.copy()
        self._jacobian = np.zeros((6, model.nv))
        # Views of the plan's memory: they follow it.
        self._angles = self._plan.qpos[:7]
        self._palm, self._palm_turned = self._plan.site_xpos[self._site], self._plan.site_xmat[self._site]
        self._still = self._turned = False
        for _ in range(200):
            self._solve(0.1)

    @property
    def angles_rad(self) -> NDArray[np.float64]:
        """Joint angles to go to now, float64 (7,)."""
        return np.array(self._angles)

    def lead(self, palm_m: NDArray[np.float64], rotation: NDArray[np.float64] | None = None) -> None:
        """Set where the palm shall go, and how it shall be turned; ``None``: as it was asked to be last."""
        if rotation is None:
            rotation = self._target_rotation
        if not (np.array_equal(palm_m, self._target) and np.array_equal(rotation, self._target_rotation)):
            self._turned = self._turned and np.array_equal(rotation, self._target_rotation)
            self._target, self._target_rotation, self._still = palm_m, rotation, False

    def tick(self, dt_s: float) -> None:
        """Go on by one tick."""
        if self._still:
            return
        away = self._target - self._place
        distance = math.sqrt(away @ away)
        wanted = np.zeros(3)
        if distance > 1e-9:
            # The speed from which braking ends at the target, a tick early so that it isn't overrun.
            reach = _ACCELERATION_M_S2 * dt_s
            brake = math.sqrt(reach * reach / 4 + 2 * _ACCELERATION_M_S2 * distance) - reach / 2
            wanted = away * (min(_SPEED_M_S, brake, distance / dt_s) / distance)
        change = wanted - self._velocity
        size = math.sqrt(change @ change)
        most = _ACCELERATION_M_S2 * dt_s
        self._velocity += change if size <= most else change * (most / size)
        self._place += self._velocity * dt_s
        if not self._turned:
            turn = _rotation_between(self._rotation, self._target_rotation)
            angle = math.sqrt(turn @ turn)
            self._turned = angle <= 1e-9
            if not self._turned:
                self._rotation = _rotation(turn * min(1.0, _TURN_RAD_S * dt_s / angle)) @ self._rotation
        left = self._solve(dt_s)
        self._still = left < 1e-6 and distance < 1e-7 and self._turned

    def _solve(self, dt_s: float) -> float:
        """Take one step to the joint angles of the place; return how far they went, rad."""
        mujoco, plan = self._mujoco, self._plan
        mujoco.mj_kinematics(self._model, plan)
        mujoco.mj_comPos(self._model, plan)
        jacobian = self._jacobian
        mujoco.mj_jacSite(self._model, plan, jacobian[:3], jacobian[3:], self._site)
        arm = jacobian[:, :7]
        error = np.empty(6)
        error[:3] = self._place - self._palm
        error[3:] = _rotation_between(self._palm_turned.reshape(3, 3), self._rotation)
        # The pull towards the posture, but for what of it would move the palm, is left to the damped inverse.
        pull = _POSTURE_PULL * (ARM_POSTURE_RAD - self._angles)
        square, solved = arm @ arm.T + _DAMPED, np.empty(6)
        mujoco.mju_cholFactor(square, 0.0)
        mujoco.mju_cholSolve(solved, square, error - arm @ pull)
        step = pull + arm.T @ solved
        most = ARM_SPEEDS_RAD_S * dt_s
        before = self._angles.copy()
        step = np.minimum(np.maximum(step, -most), most)
        self._angles[:] = np.minimum(np.maximum(before + step, _LOWEST_RAD), _HIGHEST_RAD)
        return float(np.abs(self._angles - before).max())


def _rotation_between(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return axis times angle of the turn that leads from one rotation to another, world frame."""
    (a, b, c), (d, e, f), (g, h, i) = one.tolist()
    (j, k, l), (m, n, o), (p, q, r) = other.tolist()  # noqa: E741  # nine letters for nine numbers
    # The turn is other · oneᵀ; of it only the part that turns and the trace are needed.
    x = p * d + q * e + r * f - m * g - n * h - o * i
    y = j * g + k * h + l * i - p * a - q * b - r * c
    z = m * a + n * b + o * c - j * d - k * e - l * f
    sine = math.sqrt(x * x + y * y + z * z) / 2
    cosine = (j * a + k * b + l * c + m * d + n * e + o * f + p * g + q * h + r * i - 1) / 2
    share = 0.5 if sine < 1e-9 else math.atan2(sine, cosine) / (2 * sine)
    return np.array([share * x, share * y, share * z])


def _rotation(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    angle = float(np.sqrt(vector @ vector))
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turned: NDArray[np.float64] = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * (cross @ cross)
    return turned
