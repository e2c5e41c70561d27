"""A recording as a LeRobot dataset, format v3.0, written without the package ``lerobot``."""

from __future__ import annotations

from tega.recording.lerobot.dataset import export_lerobot

__all__ = ["export_lerobot"]
