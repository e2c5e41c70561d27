"""Records of a person's calibration, as `calibrate` keeps them; each field can be given."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from tega.config.calibration.records import EmgRecord, TouchRecord, VestCalibration
from tega.config.calibration.store import Calibration, EmgMaxima, TouchMaxima, save_calibration

NOW: Final = datetime(2026, 11, 21, 15, 4, 5, tzinfo=UTC)
VEST: Final = "127.0.0.1_15881"
_THREE = (1.0, 1.0, 1.0)


def muscle_file(folder: Path, *full: float, rate_hz: float) -> Path:
    """Write a calibration of raw EMG channels with these maxima, and return its file."""
    names = tuple(f"ch{k}" for k in range(1, len(full) + 1))
    emg = EmgMaxima(kind="raw", rate_hz=rate_hz, tau=round(rate_hz / 10), channels=names, maxima=full)
    save_calibration(Calibration(preset="live", origin="a test", emg=emg), folder / "c.toml")
    return folder / "c.toml"


def touch(**more: Any) -> TouchRecord:
    """Return a fingertip's maxima."""
    full = TouchMaxima(cci_max=1.0, eda_max=9000.0)
    fields: dict[str, Any] = {
        "person": "p01",
        "device": "D20641",
        "driver": "digit",
        "made": NOW,
        "finger": "thumb",
        "n_presses": 5,
        "baseline": "gels/D20641/x.png",
        "baseline_made": NOW,
        "width_px": 240,
        "height_px": 320,
        "live": full,
        "paper": full,
    }
    return TouchRecord(**(fields | more))


def muscles(**more: Any) -> EmgRecord:
    """Return rest and maxima of three channels."""
    fields: dict[str, Any] = {
        "person": "p01",
        "device": "ttyUSB0",
        "driver": "chords",
        "made": NOW,
        "kind": "raw",
        "rate_hz": 500.0,
        "tau_samples": 50,
        "settings": "",
        "unit": "counts",
        "channels": ("ch1", "ch2", "ch3"),
        "muscles": ("a", "b", "c"),
        "offset": _THREE,
        "rest": _THREE,
        "live_max": _THREE,
        "paper_max": _THREE,
        "answers": (_THREE,) * 3,
    }
    return EmgRecord(**(fields | more))


def worn(**more: Any) -> VestCalibration:
    """Return thresholds of a vest, found at one column."""
    fields: dict[str, Any] = {
        "person": "p01",
        "device": VEST,
        "driver": "bhaptics-player",
        "made": NOW,
        "layout": "x40",
        "ceiling_percent": 60,
        "sites": ("f1",),
        "threshold_percent": (10.0,),
        "step_percent": (5.0,),
        "named_right": 8,
        "named": 8,
        "false_alarms": 0,
    }
    return VestCalibration(**(fields | more))
