"""Declare the export of recordings as ROS 2 bags."""

from __future__ import annotations

from tega.runtime.features import Feature

FEATURE = Feature(
    summary="Export of recordings as ROS 2 bags.",
    formats={"ros2": "tega_ros2.export_format:FORMAT"},
    extra="ros2",
)
