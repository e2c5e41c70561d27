"""Describe the 7-joint Panda arm, which carries the hand, as an MJCF fragment, and lead it where the forearm goes.

Kinematics and limits are the maker's published ones. Link masses are rounded identified values; the arm is
compensated for gravity and for the hand it carries, as the real one is, and is as stiff as its joint controller.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

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
        f'<intvelocity name="arm{number}" joint="arm{number}" kp="{stiffness}" dampratio="1" '
        f'actrange="{low} {high}" forcerange="{-torque} {torque}"/>'
        for number, stiffness, torque, (low, high) in zip(
            range(1, 8), _STIFFNESS_NM, _TORQUES_NM, ARM_LIMITS_RAD, strict=True
        )
    )


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
