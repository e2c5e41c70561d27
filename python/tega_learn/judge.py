"""Judge closures against a target: agreement, steadiness, delay, false closings, confidence."""

from __future__ import annotations

from typing import Final

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega.errors import ShapeError
from tega_learn.score import changes_per_second, delay_s, pearson, rank_correlation

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

    Args:
        closure: 0 to 1, a block each, ``(k,)``.
        level: 1 to 5, ``(k,)``.
        target: Closure meant, 0 to 1, ``(k,)``.
        block_s: Length of a block, s.
        paper: Levels of the rules of ``paper``, for the delay.
        confidence: Confidence of each block, 0 to 1; NaN or ``None`` if the decoder reports none.
        held: True for each block that was held.

    Raises:
        ShapeError: The series differ in length, or have fewer than three blocks.

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
