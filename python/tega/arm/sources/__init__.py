"""Give forearm poses from a recording, a script, keys, or a device that gives speeds.

All sources meet :class:`~tega.arm.PoseSource`. Those here give poses in the base's axes (``frame = "base"``), but for a
recording, whose axes are those it was recorded in.
"""

from __future__ import annotations

from tega.arm.sources.keyboard import POSE_KEYS_HELP, KeyboardPoses
from tega.arm.sources.rates import RatePoses
from tega.arm.sources.recorded import RecordedPoses, read_poses, write_poses
from tega.arm.sources.scripted import ScriptedPoses, Waypoint, path_through

__all__ = [
    "POSE_KEYS_HELP",
    "KeyboardPoses",
    "RatePoses",
    "RecordedPoses",
    "ScriptedPoses",
    "Waypoint",
    "path_through",
    "read_poses",
    "write_poses",
]
