"""Simulate the bench's Panda in a process of its own, where no robot is: an arm of a run by rigid-body physics."""

from __future__ import annotations

import time
from typing import Any, ClassVar, Final, Literal

import numpy as np

from tega.arm.messages import HandSeen, Quaternion, Triple
from tega.arm.rotation import from_matrix, to_matrix
from tega.devices.arm.robot.driver import ArmOptions, ProcessArm
from tega.devices.base import Options
from tega.errors import TegaError

_HAND_TICK_S: Final = 3e-3
# A process that was away does not make up for more: the arm stood still meanwhile.
_MOST_S: Final = 0.05
_BACK_M: Final = 0.12
_OPEN: Final = 1
# The bench's own origin is on the table, where the object stands; here it lies half a metre before the arm.
_ORIGIN: Final = np.array([0.5, 0.0, 0.0])


class BenchBody:
    """The bench's arm with its hand open, before an object on a table; time passes as it passes. Simulated.

    The base's origin is on the table's plane, 0.5 m behind where the object stands; x is along the fingers, z
    up. ``options`` has ``object``, a name of :data:`tega_sim.world.OBJECTS`.
    """

    success_rate: float | None = None

    def __init__(self, options: dict[str, Any]) -> None:
        self._object: str = options["object"]
        self._fault = ""
        self._led = False
        self.facts: tuple[str, ...] = (f"simulated: the bench's Panda before a {self._object}, no robot",)

    def open(self) -> None:
        """Build the scene."""
        from tega_sim.world import FULL_DUTY_NM, World, hand_controller

        self._world = World(self._object, seed=0, start_m=(0.0, _BACK_M))
        self._controller, self._full_nm = hand_controller(), FULL_DUTY_NM
        self._t_s, self._looked_s = 0.0, time.monotonic()
        self._fault = ""

    def observe(self) -> HandSeen:
        """Let the time pass that has passed, and return where the palm is."""
        now_s = time.monotonic()
        until_s = self._t_s + min(now_s - self._looked_s, _MOST_S)
        self._looked_s = now_s
        try:
            while not self._fault and self._t_s + _HAND_TICK_S <= until_s:
                self._t_s += _HAND_TICK_S
                self._world.set_torques(self._full_nm * self._controller.step(self._world.angles_rad, _OPEN))
                self._world.advance_to(self._t_s)
        except TegaError as error:
            self._fault, self._led = f"the simulated motion ran away: {error.message}", False
        self._looked_s -= max(0.0, until_s - self._t_s)
        palm_m, turn = self._world.palm_pose
        x, y, z = (palm_m + _ORIGIN).tolist()
        qx, qy, qz, qw = from_matrix(turn).tolist()
        return HandSeen(time.monotonic_ns(), (x, y, z), (qx, qy, qz, qw))

    def begin(self) -> None:
        """Begin to follow, from where the arm is."""
        self._stay()
        self._led = True

    def lead(
        self,
        place: Triple,
        turn: Quaternion,
        velocity_m_s: Triple,  # noqa: ARG002  # its follower finds its own speeds
        velocity_rad_s: Triple,  # noqa: ARG002
    ) -> None:
        """Give the arm its next target."""
        self._world.set_palm(np.array(place) - _ORIGIN, to_matrix(np.array(turn)))

    def rest(self) -> None:
        """Hold the arm where it is: its joints are stiff, as with the brakes on."""
        self._stay()
        self._led = False

    def _stay(self) -> None:
        palm_m, turn = self._world.palm_pose
        self._world.set_palm(palm_m, turn)

    @property
    def in_control(self) -> bool:
        """Whether the arm follows."""
        return self._led

    def fault(self) -> str:
        """Return why the physics cannot go on, ``""`` while it can."""
        return self._fault

    def recover(self) -> str:
        """Begin with a new scene."""
        self.open()
        return self._fault

    def close(self) -> None:
        """Stop following."""
        self._led = False


class BenchArmOptions(ArmOptions, frozen=True, kw_only=True):
    """Settings of :class:`BenchArm`.

    Attributes:
        object: What stands before the hand.
    """

    object: Literal["bottle", "container", "bag"] = "bottle"


class BenchArm(ProcessArm):
    """Simulates a Panda with an open hand; see :class:`BenchBody`."""

    name: ClassVar[str] = "bench-arm"
    summary: ClassVar[str] = "simulated: the bench's Panda by physics, in a process of its own"
    extra: ClassVar[str] = "sim"
    requires: ClassVar[tuple[str, ...]] = ("mujoco",)
    options_type: ClassVar[type[Options]] = BenchArmOptions
    body: ClassVar[str] = "tega_sim.bench_arm:BenchBody"
    open_s: ClassVar[float] = 60.0

    @classmethod
    def harmless(cls, options: BenchArmOptions) -> BenchArmOptions:
        """Return the options as they are: nothing real moves."""
        return options
