"""Define what the steps of a calibration share: person, settings, records, guide, and durations."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from typing import NamedTuple

from tega.config import SessionConfig
from tega.config.calibration.folder import CalibrationFolder
from tega.runtime.guide import Guide


class Times(NamedTuple):
    """Durations of the steps, seconds.

    Attributes:
        presses_s: Without enough presses for so long the person is asked whether to go on.
        get_ready_s: Between a signal and the start of its step.
        pause_s: Between two squeezes: a strong squeeze tires.
        movement_s: One muscle alone.
        pulse_s: One vibration.
        gap_s: Between the two vibrations of a pair.
    """

    baseline_s: float = 1.5
    presses_s: float = 60.0
    get_ready_s: float = 2.0
    rest_s: float = 5.0
    squeeze_s: float = 4.0
    pause_s: float = 30.0
    movement_s: float = 3.0
    pulse_s: float = 0.5
    gap_s: float = 0.3

    def scaled(self, by: float) -> Times:
        """Return the durations times a factor; noise and muscles do not hurry, so baseline and pauses stay."""
        times = Times(*(value * by for value in self))
        return times._replace(
            baseline_s=self.baseline_s, pause_s=self.pause_s, presses_s=max(3.0, times.presses_s)
        )


class Sitting(NamedTuple):
    """One person's calibration with some settings; ``now`` returns the time of day."""

    config: SessionConfig
    person: str
    folder: CalibrationFolder
    guide: Guide
    times: Times
    now: Callable[[], datetime]
