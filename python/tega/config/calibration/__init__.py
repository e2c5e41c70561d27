"""Calibrate fingertips, muscles and vest for a person; keep the maxima that turn measurements into 0 to 1."""

from __future__ import annotations

from tega.config.calibration.store import (
    Calibration,
    EmgMaxima,
    TouchMaxima,
    load_calibration,
    save_calibration,
)

__all__ = ["Calibration", "EmgMaxima", "TouchMaxima", "load_calibration", "save_calibration"]
