"""Simulate an arm in a process of its own, where no robot is."""

from __future__ import annotations

from typing import ClassVar

from tega.devices.arm.robot.driver import ArmOptions, ProcessArm
from tega.devices.base import Options


class SimulatedArmOptions(ArmOptions, frozen=True, kw_only=True):
    """Settings of :class:`SimulatedArm`.

    Attributes:
        place_m: Where its hand is at the start, base's axes.
        turn_xyzw: How it is turned; the default has its z along the base's x.
    """

    place_m: tuple[float, float, float] = (0.5, 0.0, 0.3)
    turn_xyzw: tuple[float, float, float, float] = (0.0, 0.7071067811865476, 0.0, 0.7071067811865476)


class SimulatedArm(ProcessArm):
    """A hand of 1 kg on a damped spring; see :class:`tega.devices.arm.robot.spring_body.SpringBody`."""

    name: ClassVar[str] = "simulated-arm"
    summary: ClassVar[str] = "simulated: a hand on a damped spring, in a process of its own"
    options_type: ClassVar[type[Options]] = SimulatedArmOptions
    body: ClassVar[str] = "tega.devices.arm.robot.spring_body:SpringBody"

    @classmethod
    def harmless(cls, options: SimulatedArmOptions) -> SimulatedArmOptions:
        """Return the options as they are: nothing real moves."""
        return options
