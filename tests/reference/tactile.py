"""Equations 1 to 6 and the `paper` reading in fractions: slow, exact, written from the equations alone."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal, localcontext
from fractions import Fraction
from math import floor

import numpy as np
from numpy.typing import NDArray

Grey = list[list[Fraction]]


@dataclass(frozen=True)
class Exact:
    """Exact metrics; irrational ones as 60-digit decimals."""

    mass: Fraction
    peak: Fraction
    peak_xy: tuple[int, int]
    in_contact: bool
    centroid_xy: tuple[Fraction, Fraction] | None = None
    spread: Decimal | None = None
    threshold: Decimal | None = None
    eda: int = 0
    cci: Fraction = Fraction(0)


def printed(value: float) -> Fraction:
    """Return the decimal that `value` prints as."""
    return Fraction(repr(float(value)))


def grey_map(
    frame: NDArray[np.uint8],
    baseline: NDArray[np.uint8],
    weights: tuple[float, float, float] = (0.299, 0.587, 0.114),
    order: str = "bgr",
    difference: str = "signed",
) -> Grey:
    """Eq 1."""
    by_name = dict(zip("rgb", map(printed, weights), strict=True))
    per_channel = [by_name[name] for name in order]

    def change(new: int, old: int) -> int:
        d = int(new) - int(old)
        return {"signed": d, "rectified": max(d, 0), "absolute": abs(d)}[difference]

    height, width, _ = frame.shape
    return [
        [
            sum(
                (w * change(frame[y, x, c], baseline[y, x, c]) for c, w in enumerate(per_channel)),
                start=Fraction(0),
            )
            for x in range(width)
        ]
        for y in range(height)
    ]


def root(value: Fraction) -> Decimal:
    """Return the square root to 60 digits."""
    with localcontext() as ctx:
        ctx.prec = 60
        return (Decimal(value.numerator) / Decimal(value.denominator)).sqrt()


def above(grey: Fraction, value: Fraction, factor: Fraction, variance: Fraction) -> bool:
    """Decide grey > value − factor·√variance without rounding."""
    gap = value - grey
    step_square = factor * factor * variance
    if factor >= 0:
        return gap < 0 or step_square > gap * gap
    return gap < 0 and step_square < gap * gap


def bilinear(grey: Grey, x: Fraction, y: Fraction) -> Fraction:
    """Sample between pixels, after clamping into the image."""
    height, width = len(grey), len(grey[0])
    x, y = min(max(x, Fraction(0)), Fraction(width - 1)), min(max(y, Fraction(0)), Fraction(height - 1))
    x0, y0 = floor(x), floor(y)
    x1, y1 = min(x0 + 1, width - 1), min(y0 + 1, height - 1)
    u, v = x - x0, y - y0
    top = grey[y0][x0] * (1 - u) + grey[y0][x1] * u
    bottom = grey[y1][x0] * (1 - u) + grey[y1][x1] * u
    return top * (1 - v) + bottom * v


def metrics_of_map(
    grey: Grey,
    *,
    spread: str = "spatial",
    factor: float = 1.28,
    centroid_value: str = "nearest",
    gate: tuple[float, int] | None = None,
    floor_value: Fraction | None = None,
) -> Exact:
    """Eq 2 to 6 on a grey map; `floor_value` is the lowest threshold of the paper preset."""
    height, width = len(grey), len(grey[0])
    cells = [(x, y, grey[y][x]) for y in range(height) for x in range(width)]
    mass = sum((n for _, _, n in cells), start=Fraction(0))
    peak = max(n for _, _, n in cells)
    peak_xy = next((x, y) for x, y, n in cells if n == peak)
    none = Exact(mass, peak, peak_xy, in_contact=False)
    if gate is not None and sum(n > printed(gate[0]) for _, _, n in cells) < gate[1]:
        return none
    if mass <= 0:
        return none
    mu_x = sum((x * n for x, _, n in cells), start=Fraction(0)) / mass
    mu_y = sum((y * n for _, y, n in cells), start=Fraction(0)) / mass
    if spread == "spatial":
        variance = (
            sum((((x - mu_x) ** 2 + (y - mu_y) ** 2) * n for x, y, n in cells), start=Fraction(0)) / mass
        )
    else:
        mean = mass / len(cells)
        variance = sum(((n - mean) ** 2 for _, _, n in cells), start=Fraction(0)) / len(cells)
    if variance < 0:
        return none
    if centroid_value == "nearest":
        column = min(max(floor(mu_x + Fraction(1, 2)), 0), width - 1)
        row = min(max(floor(mu_y + Fraction(1, 2)), 0), height - 1)
        value = grey[row][column]
    else:
        value = bilinear(grey, mu_x, mu_y)
    f = printed(factor)
    eda = sum(above(n, value, f, variance) and (floor_value is None or n > floor_value) for _, _, n in cells)
    with localcontext() as ctx:
        ctx.prec = 60
        threshold = Decimal(value.numerator) / Decimal(value.denominator) - Decimal(f.numerator) / Decimal(
            f.denominator
        ) * root(variance)
        if floor_value is not None:
            threshold = max(threshold, Decimal(floor_value.numerator) / Decimal(floor_value.denominator))
    return Exact(
        mass,
        peak,
        peak_xy,
        in_contact=True,
        centroid_xy=(mu_x, mu_y),
        spread=root(variance),
        threshold=threshold,
        eda=eda,
        cci=peak / eda if eda else Fraction(0),
    )


def read_paper(frame: NDArray[np.uint8], baseline: NDArray[np.uint8], order: str = "bgr") -> Exact:
    """Read as the `paper` preset is described: absolute, 5×5 mean, noise floor 6, at least 30 pixels."""
    sharp = grey_map(frame, baseline, order=order, difference="absolute")
    height, width = len(sharp), len(sharp[0])

    def mirror(i: int, side: int) -> int:
        while not 0 <= i < side:
            i = -i if i < 0 else 2 * (side - 1) - i
            if side == 1:
                return 0
        return i

    offsets = range(-2, 3)
    blurred = [
        [
            sum(
                (sharp[mirror(y + j, height)][mirror(x + i, width)] for j in offsets for i in offsets),
                start=Fraction(0),
            )
            / 25
            for x in range(width)
        ]
        for y in range(height)
    ]
    noise_floor = Fraction(6)
    masked = [[n if n >= noise_floor else Fraction(0) for n in row] for row in blurred]
    return metrics_of_map(masked, gate=(6.0, 30), floor_value=noise_floor)
