"""Look up how long the motors of a run's vest take to start, where that was measured."""

from __future__ import annotations

from statistics import median
from typing import Final, NamedTuple

from tega.config.calibration.folder import CalibrationFolder, device_name
from tega.config.person import closed_info
from tega.config.sections import SessionConfig

STAGE: Final = "motor onset"
"""How the stage's name begins in a recording; the day it was measured follows."""


class MotorOnset(NamedTuple):
    """Measured time from the hand-over of a frame to a vest's first vibration.

    ``made`` is the day of the oldest of these measurements, such as ``2026-11-21``; ``uncertainty_ms`` is how
    far it may be off, by the clock of the recordings.
    """

    ms: float
    device: str
    motors: tuple[int, ...]
    made: str
    uncertainty_ms: float

    @property
    def stage(self) -> str:
        """Name of the onset in a table of stages."""
        return f"{STAGE}, measured {self.made}"

    @property
    def words(self) -> str:
        """The onset in one line of words."""
        which = "motor" if len(self.motors) == 1 else "motors"
        return (
            f"{self.stage}: {self.ms:.0f} ms ± {self.uncertainty_ms:.0f} "
            f"({which} {', '.join(map(str, self.motors))} of {self.device}); in the stage 'skin'"
        )


def motor_onset(config: SessionConfig) -> MotorOnset | None:
    """Return the measured onset of the settings' vest, from ``calibration.folder``; ``None`` for none."""
    vest, folder = config.vest, config.calibration.folder
    if vest.driver is None or folder is None:
        return None
    info = closed_info(vest, "vest")
    records = [] if info is None else CalibrationFolder(folder).onsets(device_name(info))
    if not records:
        return None
    return MotorOnset(
        ms=median(record.onset_ms for record in records),
        device=records[0].device,
        motors=tuple(record.motor for record in records),
        made=f"{min(record.made for record in records):%Y-%m-%d}",
        uncertainty_ms=max(record.clock_uncertainty_ms for record in records),
    )
