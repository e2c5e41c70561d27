"""Equations 1 to 6 in whole numbers and fractions, from the equations alone, for frames of any size."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal, localcontext
from fractions import Fraction
from math import floor, lcm

import numpy as np
from numpy.typing import NDArray

__all__ = ["ExactContact", "exact_contact"]

DIGITS = 60
# Differences of bytes lie within ±255; three of them make one code.
SPAN = 511


@dataclass(frozen=True)
class ExactContact:
    """Exact metrics of one frame; irrational ones to 60 digits. Without contact only the first four have a value."""

    in_contact: bool
    mass: Fraction
    peak: Fraction
    peak_xy: tuple[int, int]
    centroid_xy: tuple[Fraction, Fraction] = (Fraction(0), Fraction(0))
    spread: Decimal = Decimal(0)
    threshold: Decimal = Decimal(0)
    threshold_parts: Decimal = Decimal(0)
    """What the threshold is the difference of, in size: its rounding is a share of this."""
    eda: int = 0
    cci: Fraction = Fraction(0)


def exact_contact(
    frame: NDArray[np.uint8],
    baseline: NDArray[np.uint8],
    *,
    weights: tuple[float, float, float],
    difference: str,
    spread: str,
    factor: float = 1.28,
) -> ExactContact:
    """Compute Eq 1 to 6 exactly, with I(μ) at the nearest pixel.

    Args:
        frame: uint8 (H, W, 3) in the order blue, green, red.
        baseline: The same.
        weights: (ω_r, ω_g, ω_b), taken as the decimals they print as.
        difference: "signed", "rectified" or "absolute".
        spread: "spatial" or "intensity".
        factor: The 1.28 of Eq 4, taken as the decimal it prints as.

    Returns:
        The metrics.
    """
    change = frame.astype(np.int16) - baseline
    if difference == "rectified":
        np.maximum(change, 0, out=change)
    elif difference == "absolute":
        np.abs(change, out=change)
    height, width, _ = change.shape
    shares = [Fraction(repr(float(w))) for w in reversed(weights)]
    scale = lcm(*(s.denominator for s in shares))
    whole = [int(s * scale) for s in shares]

    def weigh(parts: list[int]) -> int:
        return sum(w * p for w, p in zip(whole, parts, strict=True))

    columns, rows = change.sum(axis=0, dtype=np.int64), change.sum(axis=1, dtype=np.int64)
    x, y = np.arange(width, dtype=np.int64), np.arange(height, dtype=np.int64)
    mass = weigh(columns.sum(axis=0).tolist())
    codes = (
        ((change[..., 0].astype(np.int32) + 255) * SPAN + change[..., 1] + 255) * SPAN + change[..., 2] + 255
    )
    distinct, counts = np.unique(codes, return_counts=True)
    levels = [weigh([c // SPAN**2 - 255, c // SPAN % SPAN - 255, c % SPAN - 255]) for c in distinct.tolist()]
    peak = max(levels)
    peak_codes = [c for c, n in zip(distinct.tolist(), levels, strict=True) if n == peak]
    first = int(np.isin(codes, peak_codes).argmax())
    known = ExactContact(
        in_contact=False,
        mass=Fraction(mass, scale),
        peak=Fraction(peak, scale),
        peak_xy=(first % width, first // width),
    )
    if mass <= 0:
        return known
    centre_x = Fraction(weigh((x @ columns).tolist()), mass)
    centre_y = Fraction(weigh((y @ rows).tolist()), mass)
    if spread == "spatial":
        squares = weigh(((x * x) @ columns + (y * y) @ rows).tolist())
        variance = Fraction(squares, mass) - centre_x**2 - centre_y**2
    else:
        n = height * width
        squares = sum(k * level**2 for k, level in zip(counts.tolist(), levels, strict=True))
        variance = Fraction(n * squares - mass**2, (n * scale) ** 2)
    if variance < 0:
        return known
    column = min(max(floor(centre_x + Fraction(1, 2)), 0), width - 1)
    row = min(max(floor(centre_y + Fraction(1, 2)), 0), height - 1)
    value = Fraction(weigh(change[row, column].tolist()), scale)
    step = Fraction(repr(factor))
    eda = sum(
        k
        for k, level in zip(counts.tolist(), levels, strict=True)
        if _exceeds(Fraction(level, scale), value, step**2 * variance)
    )
    with localcontext() as context:
        context.prec = DIGITS
        sigma = (Decimal(variance.numerator) / Decimal(variance.denominator)).sqrt()
        at_centre = Decimal(value.numerator) / Decimal(value.denominator)
        below = Decimal(step.numerator) / Decimal(step.denominator) * sigma
        threshold, parts = at_centre - below, abs(at_centre) + below
    return ExactContact(
        in_contact=True,
        mass=known.mass,
        peak=known.peak,
        peak_xy=known.peak_xy,
        centroid_xy=(centre_x, centre_y),
        spread=sigma,
        threshold=threshold,
        threshold_parts=parts,
        eda=eda,
        cci=known.peak / eda if eda else Fraction(0),
    )


def _exceeds(grey: Fraction, value: Fraction, step_squared: Fraction) -> bool:
    """Decide grey > value - √step_squared without a root."""
    gap = value - grey
    return gap < 0 or step_squared > gap * gap
