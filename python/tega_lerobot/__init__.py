"""Export a recording as a LeRobot dataset, format v3.0, without the package ``lerobot``."""

from __future__ import annotations

from tega_lerobot.dataset import export_lerobot

__all__ = ["export_lerobot"]
