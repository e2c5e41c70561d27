"""Contact metrics (Eq 1 to 6) and the `paper` preset in whole numbers and fractions, for frames of any size."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal, localcontext
from fractions import Fraction
from functools import reduce
from math import floor, lcm
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["DIGITS", "ExactContact", "exact_contact", "exact_paper", "printed"]

DIGITS = 60
LUMA = (0.299, 0.587, 0.114)
# The `paper` preset: 5×5 mean, noise floor in grey values, fewest pixels above it.
BOX, NOISE_FLOOR, FEWEST_PIXELS = 5, 6, 30

Image: TypeAlias = NDArray[np.uint8]
Levels: TypeAlias = NDArray[Any]
"""Whole levels, so many to a grey value: int64 where every sum fits, Python's integers where one may not."""


@dataclass(frozen=True)
class ExactContact:
    """Exact metrics of one frame; irrational ones to 60 digits. Without contact only the first four have a value.

    ``threshold_parts`` is the size of what the threshold is the difference of: its rounding is a share of this.
    """

    in_contact: bool
    mass: Fraction
    peak: Fraction
    peak_xy: tuple[int, int]
    centroid_xy: tuple[Fraction, Fraction] | None = None
    spread: Decimal | None = None
    threshold: Decimal | None = None
    threshold_parts: Decimal | None = None
    eda: int = 0
    cci: Fraction = Fraction(0)


def printed(value: float) -> Fraction:
    """Return the decimal that a number prints as."""
    return Fraction(repr(float(value)))


def exact_contact(
    frame: Image,
    baseline: Image,
    *,
    weights: tuple[float, float, float] = LUMA,
    order: str = "bgr",
    difference: str = "signed",
    spread: str = "spatial",
    factor: float = 1.28,
    centroid_value: str = "nearest",
    gate: tuple[float, int] | None = None,
) -> ExactContact:
    """Compute Eq 1 to 6 of uint8 pictures, (H, W, 3).

    Args:
        frame: The picture.
        baseline: The untouched one.
        weights: (ω_r, ω_g, ω_b), taken as the decimals they print as.
        order: Of the channels: "bgr" or "rgb".
        difference: "signed", "rectified" or "absolute".
        spread: "spatial" or "intensity".
        factor: The 1.28 of Eq 4, taken as the decimal it prints as.
        centroid_value: I(μ) at the "nearest" pixel, or "bilinear" between pixels.
        gate: A noise floor in grey values, and the fewest pixels above it that are a contact.
    """
    by_name = dict(zip("rgb", map(printed, weights), strict=True))
    shares = [by_name[name] for name in order]
    scale = lcm(*(share.denominator for share in shares))
    whole = [int(share * scale) for share in shares]
    levels = _weighed(_change(frame, baseline, difference), whole)
    least = None if gate is None else (printed(gate[0]) * scale, gate[1])
    return _of_levels(levels, scale, spread, printed(factor), centroid_value, gate=least)


def exact_paper(frame: Image, baseline: Image, order: str = "bgr") -> ExactContact:
    """Compute the `paper` preset: absolute, 5×5 mean, noise floor 6, at least 30 pixels; uint8 (H, W, 3)."""
    change = _change(frame, baseline, "absolute")
    margin = BOX // 2
    padded = np.pad(change, ((margin, margin), (margin, margin), (0, 0)), mode="reflect")
    height, width, _ = frame.shape
    of_rows = reduce(np.add, [padded[i : i + height] for i in range(BOX)])
    boxes = reduce(np.add, [of_rows[:, i : i + width] for i in range(BOX)])
    thousandths = dict(zip("rgb", (299, 587, 114), strict=True))
    levels = _weighed(boxes, [thousandths[name] for name in order])
    scale = 1000 * BOX * BOX
    lowest = NOISE_FLOOR * scale
    levels[levels < lowest] = 0
    gate = (Fraction(lowest), FEWEST_PIXELS)
    return _of_levels(levels, scale, "spatial", printed(1.28), "nearest", gate=gate, lowest=lowest)


def _change(frame: Image, baseline: Image, difference: str) -> NDArray[np.int16]:
    change = frame.astype(np.int16) - baseline
    if difference == "rectified":
        np.maximum(change, 0, out=change)
    elif difference == "absolute":
        np.abs(change, out=change)
    return change


def _weighed(change: NDArray[np.int16], whole: list[int]) -> Levels:
    """Weigh the channels; in 64 bits where squares add up in them over a row, and levels over the frame."""
    bound = int(np.abs(change).max()) * sum(map(abs, whole))
    height, width, _ = change.shape
    fits = max(bound * bound * width, bound * height * width, *map(abs, whole)) < 2**62
    kind: Any = np.int64 if fits else object
    return reduce(np.add, [change[..., k].astype(kind) * weight for k, weight in enumerate(whole)])


def _of_levels(
    levels: Levels,
    scale: int,
    spread: str,
    factor: Fraction,
    centroid_value: str,
    *,
    gate: tuple[Fraction, int] | None = None,
    lowest: int | None = None,
) -> ExactContact:
    """Equations 2 to 6 on a map of levels, ``scale`` of them a grey value; gate and lowest threshold in levels."""
    width = levels.shape[1]
    columns, rows = levels.sum(axis=0).tolist(), levels.sum(axis=1).tolist()
    mass, peak, first = sum(columns), int(levels.max()), int(levels.argmax())
    sums: dict[str, Any] = {
        "mass": Fraction(mass, scale),
        "peak": Fraction(peak, scale),
        "peak_xy": (first % width, first // width),
    }
    nothing = ExactContact(in_contact=False, **sums)
    if gate is not None and _count(levels, floor(gate[0]) + 1) < gate[1]:
        return nothing
    if mass <= 0:
        return nothing
    mu_x = Fraction(sum(x * n for x, n in enumerate(columns)), mass)
    mu_y = Fraction(sum(y * n for y, n in enumerate(rows)), mass)
    if spread == "spatial":
        second = sum(x * x * n for x, n in enumerate(columns)) + sum(y * y * n for y, n in enumerate(rows))
        variance = Fraction(second, mass) - mu_x**2 - mu_y**2
    else:
        squares = sum((levels * levels).sum(axis=1).tolist())
        variance = (Fraction(squares, levels.size) - Fraction(mass, levels.size) ** 2) / scale**2
    if variance < 0:
        return nothing
    value = _bilinear(levels, mu_x, mu_y, nearest=centroid_value == "nearest") / scale
    least = _first_above(
        value * scale, factor * factor * variance * scale**2, factor >= 0, int(levels.min()), peak
    )
    sigma = _root(variance)
    with localcontext() as context:
        context.prec = DIGITS
        at_centre, below = _decimal(value), _decimal(factor) * sigma
        threshold, parts = at_centre - below, abs(at_centre) + abs(below)
        if lowest is not None:
            threshold, least = max(threshold, _decimal(Fraction(lowest, scale))), max(least, lowest + 1)
    eda = _count(levels, least)
    return ExactContact(
        in_contact=True,
        **sums,
        centroid_xy=(mu_x, mu_y),
        spread=sigma,
        threshold=threshold,
        threshold_parts=parts,
        eda=eda,
        cci=Fraction(peak, scale * eda) if eda else Fraction(0),
    )


def _count(levels: Levels, least: int) -> int:
    """Return how many levels are at least so high."""
    if levels.dtype == np.int64 and abs(least) >= 2**62:
        return levels.size if least < 0 else 0
    return int(np.count_nonzero(levels >= least))


def _bilinear(levels: Levels, x: Fraction, y: Fraction, *, nearest: bool) -> Fraction:
    """Sample the map between pixels, or at the nearest one, after clamping into the image."""
    height, width = levels.shape
    if nearest:
        x, y = Fraction(floor(x + Fraction(1, 2))), Fraction(floor(y + Fraction(1, 2)))
    x, y = min(max(x, Fraction(0)), Fraction(width - 1)), min(max(y, Fraction(0)), Fraction(height - 1))
    x0, y0 = floor(x), floor(y)
    x1, y1 = min(x0 + 1, width - 1), min(y0 + 1, height - 1)
    u, v = x - x0, y - y0

    def at(row: int, column: int) -> int:
        return int(levels[row, column])

    top = at(y0, x0) * (1 - u) + at(y0, x1) * u
    bottom = at(y1, x0) * (1 - u) + at(y1, x1) * u
    return top * (1 - v) + bottom * v


def _first_above(value: Fraction, step_squared: Fraction, down: bool, low: int, high: int) -> int:  # noqa: FBT001
    """Return the lowest level above value - √step_squared (or + where the step is not down), without a root.

    Halves between the lowest level there is and one more than the highest.
    """

    def above(level: int) -> bool:
        gap = value - level
        if down:
            return gap < 0 or step_squared > gap * gap
        return gap < 0 and step_squared < gap * gap

    low, high = low - 1, high + 1
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if above(middle) else (middle, high)
    return high


def _decimal(value: Fraction) -> Decimal:
    return Decimal(value.numerator) / Decimal(value.denominator)


def _root(value: Fraction) -> Decimal:
    with localcontext() as context:
        context.prec = DIGITS
        return _decimal(value).sqrt()
