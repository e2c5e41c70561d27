"""Compute a recorded session again, and compare what comes out with what was recorded."""

from __future__ import annotations

from tega.recording.replay.compare import Comparison, Difference
from tega.recording.replay.recompute import Replay, replay_file

__all__ = ["Comparison", "Difference", "Replay", "replay_file"]
