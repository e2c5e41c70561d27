"""Calibration: the maxima that turn measurements into 0 to 1, and the file that keeps them."""

from __future__ import annotations

from tega.calibration.store import (
    Calibration,
    EmgMaxima,
    FingerMaxima,
    TouchMaxima,
    load_calibration,
    save_calibration,
)

__all__ = ["Calibration", "EmgMaxima", "FingerMaxima", "TouchMaxima", "load_calibration", "save_calibration"]
