"""Turn closure levels into joint targets and torques, for an Allegro Hand v4."""

from __future__ import annotations

from tega.hand.motion import (
    CLOSURE_POSES_RAD,
    JOINT_LIMITS_RAD,
    JOINT_NAMES,
    LEVEL_TORQUE_FACTORS,
    MOST_ADDED_LEVELS,
    TICK_S,
    TORQUE_LIMITS,
    HandController,
    JointModel,
    ModelledHand,
    closure_level,
    joined_level,
    nearest_level,
    split_level,
)

__all__ = [
    "CLOSURE_POSES_RAD",
    "JOINT_LIMITS_RAD",
    "JOINT_NAMES",
    "LEVEL_TORQUE_FACTORS",
    "MOST_ADDED_LEVELS",
    "TICK_S",
    "TORQUE_LIMITS",
    "HandController",
    "JointModel",
    "ModelledHand",
    "closure_level",
    "joined_level",
    "nearest_level",
    "split_level",
]
