"""Compute a recorded session again, and compare what comes out with what was recorded."""

from __future__ import annotations

from tega.replay.again import Replay, replay_file
from tega.replay.compare import Comparison, Difference

__all__ = ["Comparison", "Difference", "Replay", "replay_file"]
