"""Judge a column by its values: an evenly rising one is a time or a counter, not a muscle."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

Course = Literal["signal", "time", "counter", "label", "constant", "none"]
"""Course of a column's values: ``signal`` goes up and down, ``label`` keeps small whole numbers for long, ``none``
has too few numbers."""

FEWEST = 16
"""Rows without which values prove nothing."""
_FEWEST_LABELS = 200

# Seconds since 1970 in this range are a date between 2001 and 2096; the same in ms, µs and ns.
_UNIX_S = (1e9, 4e9)


def course_of(values: NDArray[np.float64]) -> Course:
    """Return the course of a column's first values.

    Args:
        values: float64 (n,), NaN for a cell without a number.

    Example:
        >>> course_of(np.arange(100) * 0.004), course_of(np.arange(600) % 256.0), course_of(np.zeros(50))
        ('time', 'counter', 'constant')
    """
    values = values[np.isfinite(values)]
    if len(values) < FEWEST:
        return "none"
    steps = np.diff(values)
    if not steps.any():
        return "constant"
    moved = steps[steps != 0]
    step = float(np.median(moved))
    whole = bool((values == np.round(values)).all())
    small = whole and len(values) >= _FEWEST_LABELS and 0 <= values.min() <= values.max() < 100
    if small and len(moved) <= 0.01 * len(steps):
        return "label"
    return _rising(steps, moved, step, whole=whole) if step > 0 else "signal"


def _rising(steps: NDArray[np.float64], moved: NDArray[np.float64], step: float, *, whole: bool) -> Course:
    """Return the course of values that rise more often than they fall."""
    up = float((steps >= 0).mean())
    even = float((np.abs(moved - step) <= 0.1 * step).mean())
    if whole and step >= 1 and even >= 0.9 and len(moved) >= 0.9 * len(steps):
        return "counter"
    # A stamp for several samples that came at once stands still between its steps.
    few_back = up >= 0.98 and len(moved) >= max(FEWEST, len(steps) // 200)
    near = float(((moved > 0) & (moved < 10 * step)).mean())
    if few_back and (even >= 0.5 or near >= 0.95) and len(steps) >= 2 * FEWEST:
        return "time"
    return "time" if few_back and even >= 0.9 else "signal"


def unix_unit(values: NDArray[np.float64]) -> str:
    """Return the unit in which values are times since 1970: ``s``, ``ms``, ``us``, ``ns``; ``""`` if they are not."""
    values = values[np.isfinite(values)]
    if not len(values):
        return ""
    middle = float(np.median(values))
    for unit, scale in (("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)):
        if _UNIX_S[0] * scale <= middle <= _UNIX_S[1] * scale:
            return unit
    return ""


def is_even(values: NDArray[np.float64]) -> bool:
    """Return whether nearly all steps of values are the same, as those of a time that each sample has for itself."""
    steps = np.diff(values[np.isfinite(values)])
    middle = float(np.median(steps)) if len(steps) else 0.0
    return middle > 0 and float((np.abs(steps - middle) <= 0.5 * middle).mean()) >= 0.9
