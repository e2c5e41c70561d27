"""Score how well closure levels follow a measured force: agreement, steadiness, delay.

The score of a recording is judged on data its calibration has not seen: the maxima come from the first part
of the recording, the levels from the rest.

Example:
    >>> import numpy as np
    >>> force = np.tile(np.repeat([0.0, 2.0, 0.0, 1.0], 400), 2)
    >>> swing = np.where(np.arange(3200) // 2 % 2, 1.0, -1.0)
    >>> score = score_recording((force * swing)[:, None], force, 200, tau=20, kind="raw")
    >>> score.live.rank_correlation > 0.9
    True
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega.emg.levels import BlockMean, GraspIntent, InputKind, Preset, channel_maxima
from tega.errors import InvalidValueError, ShapeError

PERCENTILES: dict[Preset, float] = {"paper": 100.0, "live": 95.0}
"""Percentile of the block means that each preset's maxima are."""


@dataclass(frozen=True)
class PresetScore:
    """Figures of one preset on one recording."""

    rank_correlation: float
    """Spearman's, of fused level with force; NaN where either never changes."""
    changes_per_s: float
    """Changes of the fused level per second."""
    delay_s: float
    """How much later than the levels of `paper` the fused levels come, s; NaN where either never changes."""


@dataclass(frozen=True)
class RecordingScore:
    """Figures of both presets on the judged part of one recording."""

    duration_s: float
    """Length of the judged part, s."""
    paper: PresetScore
    """The printed law."""
    live: PresetScore
    """The reading made for people."""


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


def score_recording(
    samples: ArrayLike,
    force: ArrayLike,
    rate_hz: float,
    *,
    tau: int,
    kind: InputKind = "raw",
) -> RecordingScore:
    """Score both presets on one recording of EMG and force.

    The first half of the recording gives the maxima (`channel_maxima`: the largest block mean for "paper", the
    95th percentile for "live"); the rest, run from a fresh start, is judged against the force averaged over the
    same blocks. It has to hold three blocks of ``tau`` samples or more.
    ``samples`` are ``(n, channels)``, or ``(n,)`` for a single channel; ``force`` is ``(n,)``, at the same
    instants, any unit.
    """
    emg, measured = np.asarray(samples), np.asarray(force, np.float64)
    if measured.ndim != 1 or len(measured) != len(emg):
        raise ShapeError(
            f"force has shape {measured.shape}, samples {emg.shape}: one force a sample is needed"
        )
    start = len(emg) // 2
    wanted = BlockMean(tau, 1).process(measured[start:])[:, 0]
    if len(wanted) < 3:
        raise ShapeError(
            f"the judged part has {len(wanted)} blocks of tau = {tau} samples, at least 3 are needed",
            "use a longer recording or a smaller tau",
        )
    levels: dict[Preset, NDArray[np.int64]] = {}
    for preset, percentile in PERCENTILES.items():
        maxima = channel_maxima(emg[:start], rate_hz, tau=tau, kind=kind, percentile=percentile)
        intent = GraspIntent(rate_hz, maxima, tau=tau, kind=kind, preset=preset)
        levels[preset] = intent.process(emg[start:])
    block_s = tau / rate_hz
    scores = {
        preset: PresetScore(
            rank_correlation=rank_correlation(fused, wanted),
            changes_per_s=changes_per_second(fused, block_s),
            delay_s=delay_s(fused, levels["paper"], block_s),
        )
        for preset, fused in levels.items()
    }
    return RecordingScore(duration_s=len(wanted) * block_s, paper=scores["paper"], live=scores["live"])


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
    """Return the correlation of two series, float64 ``(k,)``; NaN where one does not change."""
    dx, dy = x - x.mean(), y - y.mean()
    scale = float(np.sqrt((dx @ dx) * (dy @ dy)))
    return float(dx @ dy) / scale if scale > 0 else float("nan")
