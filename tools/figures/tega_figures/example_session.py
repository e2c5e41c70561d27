"""Make the recorded session of ``examples/``: part of a simulated lift of the bag, small enough to be kept.

``python -m tega_figures.example_session examples/recorded-lift``
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from tega.config import RecordingSection
from tega.ui.cli.main import main as tega_teleop
from tega_sim.demo import run_demo
from tega_sim.plan import TrialPlan
from tega_sim.streams import LiftRecorder

__all__ = ["main"]

# From before the first touch until the bag hangs; pictures that are fit to be looked at.
_FROM_S, _TO_S = 2.2, 6.8
_JPEG_QUALITY = 20


def main() -> None:
    """Write the session into the folder that is named."""
    folder = Path(sys.argv[1])
    with tempfile.TemporaryDirectory() as beside:
        whole = Path(beside) / "whole"
        recorder = LiftRecorder(whole, RecordingSection(jpeg_quality=_JPEG_QUALITY), real_time=False)
        run_demo([TrialPlan(object="bag", condition="haptic", seed=1)], real_time=False, recorder=recorder)
        part = ("--from", str(_FROM_S), "--to", str(_TO_S))
        tega_teleop(["recording", "trim", str(whole / "trial-001.mcap"), *part, "--out", str(folder)])


if __name__ == "__main__":
    main()
