"""Declare the export of recordings as LeRobot data sets."""

from __future__ import annotations

from tega.runtime.features import Feature

FEATURE = Feature(
    summary="Export of recordings as LeRobot data sets.",
    formats={"lerobot": "tega_lerobot.export_format:FORMAT"},
    extra="lerobot",
)
