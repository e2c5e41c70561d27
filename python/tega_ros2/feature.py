"""Declare ROS 2: recordings as bags, a run live by DDS, and commands of a ROS program under the run's limits."""

from __future__ import annotations

from tega.runtime.features import Feature

FEATURE = Feature(
    summary="ROS 2: recordings as bags, live topics, and commands by DDS.",
    settings={"ros2": "tega_ros2.settings:Ros2Table"},
    check="tega_ros2.settings:check_table",
    part="tega_ros2.part:open_part",
    formats={"ros2": "tega_ros2.outputs:FORMAT"},
    streams={"ros2": "tega_ros2.outputs:Ros2Stream"},
    extra="ros2",
)
