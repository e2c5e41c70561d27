"""Simulate an arm where no robot is: the driver, and the body that its process leads.

The body is a hand of 1 kg on a damped spring, as an arm under impedance control behaves in free air.
"""

from __future__ import annotations

import math
import time
from typing import Any, ClassVar

import numpy as np

from tega.arm.messages import HandSeen, Quaternion, Triple
from tega.arm.rotation import between, exp, multiply, unit
from tega.devices.arm.robot.driver import ArmOptions, ProcessArm
from tega.devices.arm.robot.leash import RobotBody
from tega.devices.base import Options


class SimulatedArm(ProcessArm):
    """A hand of 1 kg on a damped spring."""

    name: ClassVar[str] = "simulated-arm"
    summary: ClassVar[str] = "simulated: a hand on a damped spring, in a process of its own"
    options_type: ClassVar[type[Options]] = ArmOptions
    body: ClassVar[str] = "tega.devices.arm.simulated_arm:_SpringBody"

    @classmethod
    def harmless(cls, options: ArmOptions) -> ArmOptions:
        """Return the options as they are: nothing real moves."""
        return options


# Critically damped with 1 kg: 800 N/m as on the robot; turning likewise.
_PER_S2 = 800.0
_STEP_S = 1e-3
# The error that pulls is clipped, as in franky's tracker; so the hand never goes faster than clip sqrt(K) / 2.
_CLIP_M, _CLIP_RAD = 0.03, 0.2
# Where its hand is at the start, base's axes, with its z along the base's x.
_START_M, _START_XYZW = (0.5, 0.0, 0.3), (0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5))


class _SpringBody(RobotBody):
    """Simulated: x'' = K clip(target - x) - 2 sqrt(K) x', the same for turns; no gravity, joints or walls."""

    facts = ("simulated: a hand of 1 kg on a damped spring, no robot",)

    def __init__(self, _options: dict[str, Any]) -> None:
        self._x, self._q = np.array(_START_M), np.array(_START_XYZW)
        self._v, self._w = np.zeros(3), np.zeros(3)
        self._target: tuple[Any, Any] | None = None
        self._t_s = time.monotonic()

    def open(self) -> None:
        self._t_s = time.monotonic()

    def observe(self) -> HandSeen:
        now_s = time.monotonic()
        steps = min(int((now_s - self._t_s) / _STEP_S), 1000)
        self._t_s = max(self._t_s + steps * _STEP_S, now_s - _STEP_S)
        damping = 2 * math.sqrt(_PER_S2)
        for _ in range(steps):
            pull, twist = np.zeros(3), np.zeros(3)
            if self._target is not None:
                pull = _clip(self._target[0] - self._x, _CLIP_M)
                twist = _clip(between(self._q, self._target[1]), _CLIP_RAD)
            self._v += _STEP_S * (_PER_S2 * pull - damping * self._v)
            self._w += _STEP_S * (_PER_S2 * twist - damping * self._w)
            self._x += _STEP_S * self._v
            if self._w.any():
                self._q = unit(multiply(exp(_STEP_S * self._w), self._q))
        x, y, z = self._x.tolist()
        qx, qy, qz, qw = self._q.tolist()
        return HandSeen(time.monotonic_ns(), (x, y, z), (qx, qy, qz, qw))

    def begin(self) -> None:
        self._target = (self._x.copy(), self._q.copy())

    def lead(
        self,
        place: Triple,
        turn: Quaternion,
        velocity_m_s: Triple,  # noqa: ARG002  # its damping is against rest, as without the robot's feed-forward
        velocity_rad_s: Triple,  # noqa: ARG002
    ) -> None:
        self._target = (np.array(place), unit(np.array(turn)))

    def rest(self) -> None:
        self._target = None

    @property
    def in_control(self) -> bool:
        return self._target is not None

    def close(self) -> None:
        self._target = None


def _clip(vector: Any, most: float) -> Any:
    length = math.hypot(*vector.tolist())
    return vector if length <= most else vector * (most / length)
