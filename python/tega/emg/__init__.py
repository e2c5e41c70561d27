"""Turn EMG samples into a closure level (Eq 10 to 13)."""

from __future__ import annotations

from tega.emg.levels import (
    BlockMean,
    ButterworthLowpass,
    Fusion,
    GraspIntent,
    InputKind,
    Preset,
    channel_maxima,
    fuse_levels,
    grasp_level,
)

__all__ = [
    "BlockMean",
    "ButterworthLowpass",
    "Fusion",
    "GraspIntent",
    "InputKind",
    "Preset",
    "channel_maxima",
    "fuse_levels",
    "grasp_level",
]
