"""Score how well closures and levels follow a force or a target: agreement, steadiness, delay, false closings."""

from __future__ import annotations

from typing import Final

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega.emg.levels import Preset
from tega.errors import InvalidValueError, ShapeError

PERCENTILES: dict[Preset, float] = {"paper": 100.0, "live": 95.0}
"""Percentile of the block means that each preset's maxima are."""


REST_CLOSURE: Final = 0.05
CLOSING: Final = 0.125
"""Half of level 2: the hand begins to close."""
_SETTLED_S: Final = 0.5
_CONFIDENCE_BINS: Final = 5


class DecoderFigures(msgspec.Struct, frozen=True, kw_only=True):
    """Figures of one decoder on one part of a log; an undefined figure is NaN.

    Attributes:
        rank_correlation: Spearman's, of closure with target.
        level_rank_correlation: Spearman's, of level with target.
        correlation: Pearson's, of closure with target.
        rmse: Root of the mean square of closure less target, both 0 to 1.
        changes_per_s: Changes of the level per second.
        delay_s: How much later than the rules of ``paper`` the closure comes, s.
        level_delay_s: How much later than the rules of ``paper`` the level comes, s.
        target_delay_s: How much later than the target the closure comes, s.
        at_level: Share of time at the target's level, one of five.
        balanced_accuracy: Mean of the shares of rest (target below a quarter) and effort (above a half) that are
            classified correctly at closure a quarter.
        false_closings_per_min: Closings that begin at rest, per minute of rest.
        calibration_error: Mean distance of confidence from the share of blocks within one level, over five bins.
        held: Share of blocks that only repeated the closure before.
        duration_s: Length of the judged part, s.
    """

    rank_correlation: float
    level_rank_correlation: float
    correlation: float
    rmse: float
    changes_per_s: float
    delay_s: float
    level_delay_s: float
    target_delay_s: float
    at_level: float
    balanced_accuracy: float
    false_closings_per_min: float
    calibration_error: float
    held: float
    duration_s: float

    def as_json(self) -> dict[str, float | None]:
        """Return the figures by name; an undefined one is ``None``."""
        return {
            name: None if np.isnan(value) else value for name, value in msgspec.structs.asdict(self).items()
        }


def rank_correlation(a: ArrayLike, b: ArrayLike) -> float:
    """Compute Spearman's rank correlation of two series ``(n,)``, ties sharing their mean rank; NaN for a constant one.

    Example:
        >>> rank_correlation([1, 2, 3, 4], [1, 4, 9, 16])
        1.0
    """
    x, y = _pair(a, b)
    return pearson(_ranks(x), _ranks(y))


def changes_per_second(levels: ArrayLike, block_s: float) -> float:
    """Count the changes per second of levels ``(k,)``, one a block of ``block_s`` seconds; 0 for fewer than two.

    Example:
        >>> changes_per_second([1, 1, 2, 2, 1], 0.1)
        4.0
    """
    if not block_s > 0:
        raise InvalidValueError(f"block_s = {block_s} s must be greater than 0")
    values = np.asarray(levels)
    return float(np.count_nonzero(np.diff(values)) / (len(values) * block_s)) if len(values) > 1 else 0.0


def delay_s(levels: ArrayLike, reference: ArrayLike, block_s: float, *, longest_s: float = 1.0) -> float:
    """Return by how many seconds ``levels`` come later than ``reference``, both ``(k,)``, one a block of ``block_s``.

    That is the shift of ``levels``, up to ``longest_s`` either way, at which the two agree best, by their
    correlation over the blocks they share at that shift, refined between blocks by the parabola through the
    best shift and its neighbours; NaN where a series never changes.

    Example:
        >>> round(delay_s([1, 1, 1, 3, 3, 1, 1, 1], [1, 1, 3, 3, 1, 1, 1, 1], 0.1), 2)
        0.1
    """
    if not block_s > 0:
        raise InvalidValueError(f"block_s = {block_s} s must be greater than 0")
    later, earlier = _pair(levels, reference)
    furthest = min(round(longest_s / block_s), max(len(later) - 3, 0))
    shifts = range(-furthest, furthest + 1)
    agreement = np.array([pearson(*_overlap(later, earlier, shift)) for shift in shifts])
    if np.isnan(agreement).all():
        return float("nan")
    best = int(np.nanargmax(agreement))
    between = 0.0
    if 0 < best < len(shifts) - 1:
        left, peak, right = agreement[best - 1 : best + 2]
        curvature = left - 2 * peak + right
        between = 0.5 * (left - right) / curvature if curvature < 0 else 0.0
    return float((shifts[best] + between) * block_s)


def judge(
    closure: ArrayLike,
    level: ArrayLike,
    target: ArrayLike,
    block_s: float,
    *,
    paper: ArrayLike | None = None,
    confidence: ArrayLike | None = None,
    held: ArrayLike | None = None,
) -> DecoderFigures:
    """Judge a series of closures.

    Closure and the target that was meant are 0 to 1, levels 1 to 5, a block of ``block_s`` seconds each, ``(k,)``.
    ``paper`` are the levels of those rules, for the delay; ``confidence`` is NaN or ``None`` if the decoder reports
    none; ``held`` is true for each block that was held. ``ShapeError`` for series that differ in length, or have fewer
    than three blocks.

    Example:
        >>> judge([0, 0, 1, 1], [1, 1, 5, 5], [0, 0, 1, 1], 0.1).balanced_accuracy
        1.0
    """
    reported, steps, wanted = (np.asarray(a, np.float64) for a in (closure, level, target))
    if not reported.shape == steps.shape == wanted.shape or reported.ndim != 1 or len(reported) < 3:
        raise ShapeError(
            f"series have shapes {reported.shape}, {steps.shape}, {wanted.shape}: three blocks are needed"
        )
    rest, effort = wanted < 0.25, wanted > 0.5
    printed = None if paper is None else np.asarray(paper, np.float64)
    balanced = float("nan")
    if rest.any() and effort.any():
        balanced = float((reported[rest] < 0.25).mean() + (reported[effort] >= 0.25).mean()) / 2
    return DecoderFigures(
        rank_correlation=rank_correlation(reported, wanted),
        level_rank_correlation=rank_correlation(steps, wanted),
        correlation=pearson(reported, wanted),
        rmse=float(np.sqrt(((reported - wanted) ** 2).mean())),
        changes_per_s=changes_per_second(steps, block_s),
        delay_s=float("nan") if printed is None else delay_s(reported, printed, block_s),
        level_delay_s=float("nan") if printed is None else delay_s(steps, printed, block_s),
        target_delay_s=delay_s(reported, wanted, block_s),
        at_level=float((steps == np.floor(4 * wanted + 1.5)).mean()),
        balanced_accuracy=balanced,
        false_closings_per_min=_false_closings(reported, wanted, block_s),
        calibration_error=_calibration_error(reported, wanted, confidence),
        held=0.0 if held is None else float(np.asarray(held, bool).mean()),
        duration_s=len(reported) * block_s,
    )


def _pair(a: ArrayLike, b: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    x, y = np.asarray(a, np.float64), np.asarray(b, np.float64)
    if x.ndim != 1 or x.shape != y.shape:
        raise ShapeError(f"series have shapes {x.shape} and {y.shape}, expected two of the same (n,)")
    return x, y


def _overlap(
    later: NDArray[np.float64], earlier: NDArray[np.float64], shift: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    n = len(later)
    return later[max(shift, 0) : n + min(shift, 0)], earlier[max(-shift, 0) : n - max(shift, 0)]


def _ranks(values: NDArray[np.float64]) -> NDArray[np.float64]:
    _, place, counts = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(counts)
    mean_rank: NDArray[np.float64] = last - (counts - 1) / 2
    return mean_rank[place]


def pearson(x: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """Return the correlation of two series, float64 ``(k,)``; NaN for fewer than three values, or a constant series."""
    if len(x) < 3 or np.ptp(x) == 0 or np.ptp(y) == 0:
        return float("nan")
    dx, dy = x - x.mean(), y - y.mean()
    scale = float(np.sqrt((dx @ dx) * (dy @ dy)))
    return min(max(float(dx @ dy) / scale, -1.0), 1.0) if scale > 0 else float("nan")


def _false_closings(reported: NDArray[np.float64], wanted: NDArray[np.float64], block_s: float) -> float:
    """Count closings in rest that has lasted half a second and goes on for as long: muscles lead a force."""
    margin = max(1, round(_SETTLED_S / block_s))
    at_rest = wanted < REST_CLOSURE
    padded = np.pad(at_rest, margin, constant_values=True)
    settled = np.all([padded[n : n + len(at_rest)] for n in range(2 * margin + 1)], axis=0)
    begins = np.diff(reported >= CLOSING, prepend=False) & (reported >= CLOSING)
    rest_min = float(settled.sum()) * block_s / 60
    return float((begins & settled).sum()) / rest_min if rest_min > 0 else float("nan")


def _calibration_error(
    reported: NDArray[np.float64], wanted: NDArray[np.float64], confidence: ArrayLike | None
) -> float:
    if confidence is None:
        return float("nan")
    sure = np.asarray(confidence, np.float64)
    answered = np.isfinite(sure)
    if not answered.any():
        return float("nan")
    right = (np.abs(reported - wanted) <= 0.25)[answered]
    sure = sure[answered]
    bins = np.minimum((_CONFIDENCE_BINS * sure).astype(int), _CONFIDENCE_BINS - 1)
    gaps = [
        abs(sure[bins == n].mean() - right[bins == n].mean()) * (bins == n).mean()
        for n in range(_CONFIDENCE_BINS)
        if (bins == n).any()
    ]
    return float(sum(gaps))
