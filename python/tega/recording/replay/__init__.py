"""Re-run a recorded session, and compare the output with the recording."""

from __future__ import annotations

from tega.recording.replay.compare import Comparison, Difference
from tega.recording.replay.recompute import Replay, replay_file

__all__ = ["Comparison", "Difference", "Replay", "replay_file"]
