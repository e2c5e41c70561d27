"""Simulate the bench's Panda in a process of its own, where no robot is."""

from __future__ import annotations

from typing import ClassVar, Literal

from tega.devices.arm.robot.driver import ArmOptions, ProcessArm
from tega.devices.base import Options


class BenchArmOptions(ArmOptions, frozen=True, kw_only=True):
    """Settings of :class:`BenchArm`.

    Attributes:
        object: What stands before the hand.
    """

    object: Literal["bottle", "container", "bag"] = "bottle"


class BenchArm(ProcessArm):
    """Simulates a Panda with an open hand; see :class:`tega_sim.world.arm_body.BenchBody`."""

    name: ClassVar[str] = "bench-arm"
    summary: ClassVar[str] = "simulated: the bench's Panda by physics, in a process of its own"
    extra: ClassVar[str] = "sim"
    requires: ClassVar[tuple[str, ...]] = ("mujoco",)
    options_type: ClassVar[type[Options]] = BenchArmOptions
    body: ClassVar[str] = "tega_sim.world.arm_body:BenchBody"
    open_s: ClassVar[float] = 60.0

    @classmethod
    def harmless(cls, options: BenchArmOptions) -> BenchArmOptions:
        """Return the options as they are: nothing real moves."""
        return options
