"""``tega-teleop emg-score``: how well the closure levels follow a measured force."""

from __future__ import annotations

__all__ = ["emg_score"]
