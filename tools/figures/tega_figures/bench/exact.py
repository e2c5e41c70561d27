"""Equations 1 to 6 in integers and fractions: the truth that every variant's error is measured against.

Slow, exact, and written from the equations alone. The grey map is kept in thousandths of a grey value, sums are
taken in 64 bits where they fit and in Python's integers where they may not, and the threshold is compared with
levels as a fraction.
"""

from __future__ import annotations

from decimal import Decimal, localcontext
from fractions import Fraction
from functools import reduce
from math import floor, hypot, isnan
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega_figures.bench.variants import Law, Metrics

__all__ = ["ContactError", "Exact", "exact_metrics", "exact_paper", "measure_error", "worst"]

# ω of blue, green, red in thousandths, and 1.28.
WEIGHTS_BGR = (114, 587, 299)
FACTOR = Fraction(32, 25)
DIGITS = 60
# The `paper` preset: 5×5 mean, noise floor in grey values, fewest pixels above it.
BOX, NOISE_FLOOR, FEWEST_PIXELS = 5, 6, 30

Levels = NDArray[np.int64]


class Exact(NamedTuple):
    """The exact answer; the spread, a root, to 60 digits.

    Attributes:
        centroid_xy: Pixels.
        spread: Pixels or grey values.
        eda: Pixels.
        cci: Grey values per pixel.
    """

    centroid_xy: tuple[Fraction, Fraction]
    spread: Fraction
    eda: int
    cci: Fraction


class ContactError(msgspec.Struct, frozen=True, kw_only=True):
    """How far a variant's numbers lie from the exact ones.

    Attributes:
        centroid_px: Distance between the centroids, pixels.
        spread_relative: Of σ.
        eda_pixels: Difference in the number of pixels.
        cci_relative: Of CCI.
    """

    centroid_px: float
    spread_relative: float
    eda_pixels: float
    cci_relative: float


def exact_metrics(frame: NDArray[np.uint8], baseline: NDArray[np.uint8], law: Law) -> Exact:
    """Return equations 1 to 6 on one frame, for the default weights.

    Args:
        frame: uint8 (H, W, 3), BGR.
        baseline: Likewise.
        law: How the equations are read.

    Returns:
        The exact metrics.

    Raises:
        ValueError: The equations have no value on this frame.
    """
    change = frame.astype(np.int64) - baseline
    if law.difference == "rectified":
        change = np.maximum(change, 0)
    elif law.difference == "absolute":
        change = np.abs(change)
    return _of_levels(change @ np.array(WEIGHTS_BGR, np.int64), 1000, law)


def exact_paper(frame: NDArray[np.uint8], baseline: NDArray[np.uint8]) -> Exact:
    """Return the `paper` preset's reading of one frame; arguments as for :func:`exact_metrics`."""
    change = np.abs(frame.astype(np.int64) - baseline)
    margin = BOX // 2
    padded = np.pad(change, ((margin, margin), (margin, margin), (0, 0)), mode="reflect")
    height, width, _ = frame.shape
    of_rows = reduce(np.add, [padded[i : i + height] for i in range(BOX)])
    boxes = reduce(np.add, [of_rows[:, i : i + width] for i in range(BOX)])
    levels = boxes @ np.array(WEIGHTS_BGR, np.int64)
    denominator = 1000 * BOX * BOX
    levels[levels < NOISE_FLOOR * denominator] = 0
    if np.count_nonzero(levels > NOISE_FLOOR * denominator) < FEWEST_PIXELS:
        raise ValueError("no contact")
    return _of_levels(levels, denominator, Law("absolute", "spatial"), lowest=NOISE_FLOOR)


def _of_levels(levels: Levels, denominator: int, law: Law, *, lowest: int | None = None) -> Exact:
    """Equations 2 to 6 on a map of levels, ``denominator`` of them a grey value."""
    height, width = levels.shape
    columns, rows = levels.sum(axis=0).tolist(), levels.sum(axis=1).tolist()
    mass = sum(columns)
    if mass <= 0:
        raise ValueError("the mass is not positive")
    mu_x = Fraction(sum(x * n for x, n in enumerate(columns)), mass)
    mu_y = Fraction(sum(y * n for y, n in enumerate(rows)), mass)
    if law.spread == "spatial":
        second = sum(x * x * n for x, n in enumerate(columns)) + sum(y * y * n for y, n in enumerate(rows))
        variance = Fraction(second, mass) - mu_x**2 - mu_y**2
    else:
        squares = sum((levels * levels).sum(axis=1).tolist())
        variance = (Fraction(squares, levels.size) - Fraction(mass, levels.size) ** 2) / denominator**2
    if variance < 0:
        raise ValueError("the variance is negative")
    if law.centroid_value == "nearest":
        column, row = (
            _clamped(floor(mu_x + Fraction(1, 2)), width),
            _clamped(floor(mu_y + Fraction(1, 2)), height),
        )
        value = Fraction(int(levels[row, column]), denominator)
    else:
        value = _bilinear(levels, mu_x, mu_y) / denominator
    first = _first_above(value, variance, denominator)
    if lowest is not None:
        first = max(first, lowest * denominator + 1)
    eda = int(np.count_nonzero(levels >= first))
    peak = Fraction(int(levels.max()), denominator)
    return Exact((mu_x, mu_y), _root(variance), eda, peak / eda if eda else Fraction(0))


def _clamped(index: int, side: int) -> int:
    return min(max(index, 0), side - 1)


def _bilinear(levels: Levels, x: Fraction, y: Fraction) -> Fraction:
    height, width = levels.shape
    x, y = min(max(x, Fraction(0)), Fraction(width - 1)), min(max(y, Fraction(0)), Fraction(height - 1))
    x0, y0 = floor(x), floor(y)
    x1, y1 = min(x0 + 1, width - 1), min(y0 + 1, height - 1)
    u, v = x - x0, y - y0

    def at(row: int, column: int) -> int:
        return int(levels[row, column])

    top = at(y0, x0) * (1 - u) + at(y0, x1) * u
    bottom = at(y1, x0) * (1 - u) + at(y1, x1) * u
    return top * (1 - v) + bottom * v


def _first_above(value: Fraction, variance: Fraction, denominator: int) -> int:
    """Return the lowest level above T = value - 1.28·√variance, by halving; the factor is positive."""

    def above(level: int) -> bool:
        gap = value - Fraction(level, denominator)
        return gap < 0 or FACTOR**2 * variance > gap * gap

    low, high = -256 * denominator, 256 * denominator
    if above(low):
        return low
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if above(middle) else (middle, high)
    return high


def _root(value: Fraction) -> Fraction:
    with localcontext() as context:
        context.prec = DIGITS
        return Fraction((Decimal(value.numerator) / Decimal(value.denominator)).sqrt())


def measure_error(metrics: Metrics, truth: Exact) -> ContactError | None:
    """Compare a variant's answer with the exact one, whose spread and CCI are not zero.

    The differences are taken between fractions and rounded only then.

    Returns:
        The error; ``None`` where the variant has no answer.
    """
    if any(isnan(n) for n in (*metrics.centroid_xy, metrics.spread, metrics.cci)):
        return None
    dx, dy = (
        float(Fraction(own) - its) for own, its in zip(metrics.centroid_xy, truth.centroid_xy, strict=True)
    )
    return ContactError(
        centroid_px=hypot(dx, dy),
        spread_relative=_relative(metrics.spread, truth.spread),
        eda_pixels=float(abs(metrics.eda - truth.eda)),
        cci_relative=_relative(metrics.cci, truth.cci),
    )


def _relative(own: float, truth: Fraction) -> float:
    return float(abs(Fraction(own) - truth) / truth)


def worst(errors: list[ContactError | None]) -> ContactError | None:
    """Return the largest error of each number; ``None`` where there was no answer once."""
    known = [error for error in errors if error is not None]
    if len(known) < len(errors):
        return None
    return ContactError(
        centroid_px=max(e.centroid_px for e in known),
        spread_relative=max(e.spread_relative for e in known),
        eda_pixels=max(e.eda_pixels for e in known),
        cci_relative=max(e.cci_relative for e in known),
    )
