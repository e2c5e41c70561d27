"""Lead a Franka Panda through panda-python in a process of its own; written by its interface, never run on a robot."""

from __future__ import annotations

from typing import Annotated, ClassVar

import msgspec

from tega.devices.arm.franky_arm import FrankaOptions
from tega.devices.arm.robot.driver import ProcessArm
from tega.devices.arm.robot.fci import machine_findings, server_version
from tega.devices.base import Options

_SERVER = 5


class PandaArmOptions(FrankaOptions, frozen=True, kw_only=True):
    """Settings of :class:`PandaArm`; the others are those of :class:`tega.devices.arm.franky_arm.FrankaOptions`.

    Attributes:
        clip_m: The target given to the robot is no farther from its hand, so the hand goes no faster than about
            clip √K / 2.
        clip_rad: The same limit for the rotation.
    """

    clip_m: Annotated[float, msgspec.Meta(gt=0, le=0.05)] = 0.02
    clip_rad: Annotated[float, msgspec.Meta(gt=0, le=0.5)] = 0.2


class PandaArm(ProcessArm):
    """Leads the robot's hand by panda-python's impedance controller; see :mod:`tega.devices.arm.robot.panda_body`."""

    name: ClassVar[str] = "panda"
    summary: ClassVar[str] = (
        "Franka Panda through panda-python, in a process of its own; never tried on a robot"
    )
    extra: ClassVar[str] = "panda"
    requires: ClassVar[tuple[str, ...]] = ("panda_py",)
    options_type: ClassVar[type[Options]] = PandaArmOptions
    body: ClassVar[str] = "tega.devices.arm.robot.panda_body:PandaBody"
    open_s: ClassVar[float] = 60.0

    def __init__(self, options: PandaArmOptions) -> None:
        super().__init__(options)
        self._host = options.host

    @classmethod
    def preflight(cls, options: PandaArmOptions) -> list[tuple[bool, str, str]]:
        """Return whether the robot is one that panda-python's own wheel speaks to, and this machine is fit.

        Raises:
            DeviceUnavailableError: The robot does not answer.
            WrongDeviceError: The answering device is not a robot.
        """
        server = server_version(options.host)
        fix = f"install panda-python's build for robot server {server}, which its README names, or use franky"
        said = f"robot server {server} at {options.host}; panda-python's wheel speaks to server {_SERVER}"
        machine = machine_findings() if options.realtime == "enforce" else []
        return [(server == _SERVER, said, fix), *machine]

    @property
    def label(self) -> str:
        """Name of the arm, for people."""
        return f"robot at {self._host}"
