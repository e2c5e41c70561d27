"""Grasp levels and presets from EMG (Eq 10 to 13) once more, straight from the text, with no regard for speed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from decimal import Decimal
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

TOLERANCE = Fraction(1, 10**9)


def rounding_bound(rate_hz: float) -> float:
    """Return the error that passes: poles crowd towards 1 with the rate, rounding grows as its square."""
    return 1e-14 + 5e-21 * rate_hz**2


def farthest(got: NDArray[np.float64], exact: list[Decimal]) -> float:
    if not np.isfinite(got).all():
        return float("inf")
    return max(float(abs(Decimal(g) - e)) for g, e in zip(got.tolist(), exact, strict=True))


def block_means(samples: Sequence[float], tau: int) -> list[Fraction]:
    exact = [Fraction(x) for x in samples]
    return [sum(exact[i : i + tau], Fraction(0)) / tau for i in range(0, len(exact) - tau + 1, tau)]


def level(value: float | Fraction, maximum: float | Fraction) -> int:
    """Eq 11, clamped; a value within a billionth of a border is on it."""
    v, m = Fraction(value), Fraction(maximum)
    return 1 + sum(v >= Fraction(k, 4) * m * (1 - TOLERANCE) for k in (1, 2, 3, 4))


def fuse(levels: Sequence[int]) -> int:
    ranked = Counter(levels).most_common()
    if len(ranked) == 1 or ranked[0][1] > ranked[1][1]:
        return ranked[0][0]
    return int(Fraction(sum(levels), len(levels)) // 1)


def paper_levels(means: Sequence[Sequence[float]], maxima: Sequence[float]) -> list[int]:
    return [fuse([level(v, m) for v, m in zip(row, maxima, strict=True)]) for row in means]


def live_levels(means: Sequence[Sequence[float]], maxima: Sequence[float], block_s: float) -> list[int]:
    """Steadied drives, dead zones, confirmation, in the order of floating-point operations: equality is asked for."""
    scaled = [0.8 * m for m in maxima]
    drives: list[float] = []
    levels: list[int] = []
    present, last_change, requested = 0, 0, 0
    out = []
    for row in means:
        now = [v / m for v, m in zip(row, scaled, strict=True)]
        if not drives:
            drives, levels = now, [level(d, 1) for d in now]
            present = fuse(levels)
        else:
            z = [(d - s) / (0.28 * max(s, 0.0) + 0.025) for d, s in zip(now, drives, strict=True)]
            joint = max(_response(abs(_sum(sorted(z))) / len(z) ** 0.5, 1.4), block_s / (block_s + 1.0))
            gains = [max(joint, _response(deviation, 3.5)) for deviation in z]
            drives = [s + g * (d - s) for s, g, d in zip(drives, gains, now, strict=True)]
            levels = [_with_dead_zone(d, old) for d, old in zip(drives, levels, strict=True)]
            wanted = fuse(levels)
            side = (wanted > present) - (wanted < present)
            requested = requested + side if side * requested > 0 else side
            back = side == -last_change and abs(wanted - present) == 1 and wanted > 1
            if side and abs(requested) >= (4 if back else 2):
                present, last_change, requested = wanted, side, 0
        out.append(present)
    return out


def _sum(values: Iterable[float]) -> float:
    total = 0.0
    for value in values:
        total = total + value
    return total


def _response(deviation: float, half: float) -> float:
    square = (deviation / half) * (deviation / half)
    return square * square / (square * square + 1.0)


def _with_dead_zone(drive: float, old: int) -> int:
    """The level whose borders, moved away from the old level by a tenth of a level, hold the drive."""
    steps = [Fraction(10 * k + (1 if k >= old else -1), 40) * (1 - TOLERANCE) for k in (1, 2, 3, 4)]
    return 1 + sum(Fraction(drive) >= s for s in steps)
