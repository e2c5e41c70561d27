"""Compute where the arm shall hold the hand from where the operator's forearm is, without a device or a clock.

::

    pose ─► gate ─► base's axes ─► One-Euro ─► clutch ─► box, cone ─► clip ─► speed, acceleration ─► target
            jumps    yaw, mirror    at rest     relative   workspace   to the    limits, a way to
            NaN, age                smooth      no jump                measured  stop always inside

:class:`ArmChain` is all of it. Quaternions are x, y, z, w; places are metres; the base's axes are x forward, y left,
z up. Sources of poses are in :mod:`tega.devices.tracker.sources`.
"""

from __future__ import annotations

from tega.arm.chain import ArmChain
from tega.arm.frames import FRAMES
from tega.arm.heading import ForwardCheck, check_forward, yaw_from_sweep
from tega.arm.pose import ArmCommand, ArmState, Pose, PoseSource, StampedPose
from tega.arm.settings import (
    ArmSettings,
    FilterSettings,
    GateSettings,
    LimitSettings,
    MappingSettings,
    WatchdogSettings,
)

__all__ = [
    "FRAMES",
    "ArmChain",
    "ArmCommand",
    "ArmSettings",
    "ArmState",
    "FilterSettings",
    "ForwardCheck",
    "GateSettings",
    "LimitSettings",
    "MappingSettings",
    "Pose",
    "PoseSource",
    "StampedPose",
    "WatchdogSettings",
    "check_forward",
    "yaw_from_sweep",
]
