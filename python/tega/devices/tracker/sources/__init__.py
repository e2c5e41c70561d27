"""Give forearm poses from a recording, or from a device that gives speeds.

All sources meet :class:`~tega.arm.PoseSource`. Those of a device are in the base's axes
(``frame = "base"``), those of a recording in the axes that it was recorded in.
"""

from __future__ import annotations

from tega.devices.tracker.sources.rates import RatePoses
from tega.devices.tracker.sources.recorded import RecordedPoses, read_poses, write_poses

__all__ = ["RatePoses", "RecordedPoses", "read_poses", "write_poses"]
