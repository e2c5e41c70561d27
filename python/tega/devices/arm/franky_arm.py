"""Lead a Franka Panda or FR3 through franky, in a process of its own."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import msgspec

from tega.devices.arm.robot.driver import ArmOptions, ProcessArm
from tega.devices.arm.robot.fci import preflight
from tega.devices.base import Options

_Inertia = Annotated[float, msgspec.Meta(ge=0, le=1)]
_Centre = Annotated[float, msgspec.Meta(ge=-1, le=1)]
_Angle = Annotated[float, msgspec.Meta(ge=-4.6, le=4.6)]


class FrankyArmOptions(ArmOptions, frozen=True, kw_only=True):
    """Settings of :class:`FrankyArm`.

    Attributes:
        host: The robot's address.
        realtime: ``enforce`` needs a real-time kernel; ``ignore`` is for a simulator.
        stiffness_n_m: Translational stiffness of the spring that pulls the hand to the target.
        stiffness_nm_rad: Rotational stiffness of that spring.
        torque_threshold_nm: A joint that feels more stops the robot.
        force_threshold_n: A hand that feels more stops the robot.
        load_kg: Mass on the flange in addition to the one set in Desk; ``None`` keeps Desk's setting.
        load_centre_m: Its centre of mass from the flange.
        load_inertia_kg_m2: Its inertia about that centre, along the flange's axes.
        start_rad: Joint angles to go to slowly when opened; none stays where it is.
        robot: Model of the robot; the models have different joint limits.
        clip_m: The spring pulls as if the target were no farther, so the hand goes no faster than about
            clip √K / 2.
        clip_rad: The same limit for the rotation.
        torque_step_nm: A joint's torque changes by no more in a millisecond.
    """

    host: str
    realtime: Literal["enforce", "ignore"] = "enforce"
    stiffness_n_m: Annotated[float, msgspec.Meta(ge=10, le=3000)] = 400.0
    stiffness_nm_rad: Annotated[float, msgspec.Meta(ge=1, le=300)] = 20.0
    torque_threshold_nm: Annotated[float, msgspec.Meta(ge=1, le=100)] = 35.0
    force_threshold_n: Annotated[float, msgspec.Meta(ge=1, le=200)] = 60.0
    load_kg: Annotated[float, msgspec.Meta(ge=0, le=3)] | None = None
    load_centre_m: tuple[_Centre, _Centre, _Centre] = (0.0, 0.0, 0.0)
    load_inertia_kg_m2: tuple[_Inertia, _Inertia, _Inertia] = (0.001, 0.001, 0.001)
    start_rad: tuple[_Angle, _Angle, _Angle, _Angle, _Angle, _Angle, _Angle] | None = None
    robot: Literal["panda", "fr3"] = "panda"
    clip_m: Annotated[float, msgspec.Meta(gt=0, le=0.1)] = 0.03
    clip_rad: Annotated[float, msgspec.Meta(gt=0, le=1)] = 0.2
    torque_step_nm: Annotated[float, msgspec.Meta(gt=0, le=1)] = 0.5


class FrankyArm(ProcessArm):
    """Leads the robot's hand by a damped spring in torque mode; see :mod:`tega.devices.arm.robot.franky_body`."""

    name: ClassVar[str] = "franky"
    summary: ClassVar[str] = "Franka Panda or FR3 through franky, in a process of its own"
    extra: ClassVar[str] = "arm"
    requires: ClassVar[tuple[str, ...]] = ("franky",)
    options_type: ClassVar[type[Options]] = FrankyArmOptions
    body: ClassVar[str] = "tega.devices.arm.robot.franky_body:FrankyBody"
    open_s: ClassVar[float] = 60.0

    def __init__(self, options: FrankyArmOptions) -> None:
        super().__init__(options, f"robot at {options.host}")

    @classmethod
    def preflight(cls, options: FrankyArmOptions) -> list[tuple[bool, str, str]]:
        """Check whether robot, library and machine fit; see :func:`tega.devices.arm.robot.fci.preflight`."""
        return preflight(options.host, robot=options.robot, realtime=options.realtime == "enforce")
