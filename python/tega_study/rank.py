"""Compare two groups of trials by ranks: the Mann-Whitney test that the paper prints, effect size, Holm.

The tests treat every trial as a sample of its own, which trials of one person are not. Those of
:mod:`tega_study.people` reach beyond the trials at hand.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega.errors import ShapeError
from tega.runtime.lifecycle import scipy_stats

CONFIDENCE = 0.95
"""Level of every interval of a report."""
EXACT_UP_TO = 240
"""Trials in both groups together up to which the exact distribution with ties is computed (under a second)."""


class MannWhitney(NamedTuple):
    """A Mann-Whitney U test and its effect size.

    Attributes:
        u: U of the first group: pairs in which it is larger, ties as halves; ``a`` is their share (Vargha and
            Delaney's A), ``rank_biserial`` ``2 a - 1`` with its 95 % interval.
        p: Two-sided, ``exact`` where no two values are equal, else ``asymptotic`` (corrected for ties and
            continuity).
        p_asymptotic: In any case: SciPy's default from 9 against 9 on, which the paper's numbers fit.
        p_conditional: Exact given the ties; ``None`` for large groups. Equals ``p`` without ties.
    """

    u: float
    p: float
    method: str
    p_asymptotic: float
    p_conditional: float | None
    a: float
    rank_biserial: float
    low: float
    high: float


class Shift(NamedTuple):
    """Shift of one group over the other, in the unit of the values: the median of all differences (Hodges and Lehmann).

    Its confidence interval is infinite where the groups are too small for one.
    """

    estimate: float
    low: float
    high: float


def mann_whitney(x: ArrayLike, y: ArrayLike) -> MannWhitney:
    """Compare two independent groups, two-sided.

    ``ShapeError`` for an empty group.

    Example:
        >>> round(mann_whitney([1, 2, 3], [4, 5, 6]).p, 12)
        0.1
    """
    stats = scipy_stats()
    first, second = _group(x, "first"), _group(y, "second")
    n, m = len(first), len(second)
    ties = len(np.unique(np.concatenate([first, second]))) < n + m
    rough = stats.mannwhitneyu(first, second, method="asymptotic")
    u, p_asymptotic = float(rough.statistic), float(rough.pvalue)
    conditional = _conditional(first, second) if n + m <= EXACT_UP_TO else None
    p, method = p_asymptotic, "asymptotic"
    if conditional is not None and not ties:
        p, method = conditional, "exact"
    a = u / (n * m)
    low, high = rank_biserial_interval(a, n, m)
    return MannWhitney(u, p, method, p_asymptotic, conditional, a, 2 * a - 1, low, high)


def rank_sum_counts(doubled_ranks: Sequence[int], n: int) -> NDArray[np.float64]:
    """Count in how many ways ``n`` of whole numbers from 0 have each sum; float64, at place ``s`` those to ``s``."""
    top = int(sum(sorted(doubled_ranks)[-n:])) if n else 0
    ways = np.zeros((n + 1, top + 1))
    ways[0, 0] = 1.0
    for value in doubled_ranks:
        for size in range(n, 0, -1):
            ways[size, value:] += ways[size - 1, : top + 1 - value]
    counts: NDArray[np.float64] = ways[n]
    return counts


def _conditional(x: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """Two-sided p over all ways to split the very values into groups of these sizes: twice the smaller tail."""
    ranks = np.rint(2 * scipy_stats().rankdata(np.concatenate([x, y]))).astype(int)
    counts = rank_sum_counts(ranks.tolist(), len(x))
    seen = int(ranks[: len(x)].sum())
    total = counts.sum()
    return float(min(1.0, 2 * min(counts[: seen + 1].sum(), counts[seen:].sum()) / total))


def rank_biserial_interval(a: float, n: int, m: int) -> tuple[float, float]:
    """Return a confidence interval of the rank-biserial correlation of ``n`` against ``m`` values.

    Newcombe's method 5 (Statist. Med. 25 (2006) 559): the interval contains every A that is within the normal
    quantile times the standard error of the observed one, by Hanley and McNeil's model at *that* A. It stays inside
    -1 to 1, and has a width where the groups do not overlap.
    """
    z = float(scipy_stats().norm.ppf(0.5 + CONFIDENCE / 2))
    size = (n + m) / 2 - 1

    def inside(theta: float) -> bool:
        spread = 1 + size * ((1 - theta) / (2 - theta) + theta / (1 + theta))
        return abs(a - theta) <= z * math.sqrt(theta * (1 - theta) * spread / (n * m))

    def edge(outer: float) -> float:
        near, far = a, outer
        for _ in range(60):
            middle = (near + far) / 2
            near, far = (middle, far) if inside(middle) else (near, middle)
        return near

    return 2 * edge(0.0) - 1, 2 * edge(1.0) - 1


def shift(x: ArrayLike, y: ArrayLike) -> Shift:
    """Estimate how far the first group lies over the second; neither may be empty.

    The interval runs between the k-th differences from both ends, k from the exact distribution of U.
    """
    first, second = _group(x, "first"), _group(y, "second")
    n, m = len(first), len(second)
    differences = np.sort(np.round(np.subtract.outer(first, second).ravel(), 9))
    estimate = float(np.median(differences))
    if n + m > EXACT_UP_TO:
        z = float(scipy_stats().norm.ppf(0.5 + CONFIDENCE / 2))
        k = max(1, math.floor(n * m / 2 - z * math.sqrt(n * m * (n + m + 1) / 12)))
        return Shift(estimate, float(differences[k - 1]), float(differences[n * m - k]))
    counts = rank_sum_counts(range(1, n + m + 1), n)[n * (n + 1) // 2 :]
    below = np.cumsum(counts) / counts.sum()
    k = int(np.searchsorted(below, (1 - CONFIDENCE) / 2 + 1e-12, side="right"))
    if k == 0:
        return Shift(estimate, -math.inf, math.inf)
    return Shift(estimate, float(differences[k - 1]), float(differences[n * m - k]))


def holm(p: Sequence[float | None]) -> list[float | None]:
    """Correct p-values for their number (Holm, Scand. J. Statist. 6 (1979) 65); ``None`` stays, and counts as a test.

    A test that could not be made is counted with p = 1, so that a study that fell apart is not tested more mildly.

    Example:
        >>> holm([0.01, 0.04, 0.03])
        [0.03, 0.06, 0.06]
    """
    # Not statsmodels' multipletests: it collects garbage in each call, and the planner makes thousands.
    values = np.array([1.0 if one is None or math.isnan(one) else one for one in p])
    order = np.argsort(values, kind="stable")
    steps = np.minimum(1.0, values[order] * np.arange(len(values), 0, -1))
    corrected = np.empty_like(values)
    corrected[order] = np.maximum.accumulate(steps)
    return [
        None if one is None or math.isnan(one) else float(p_holm)
        for one, p_holm in zip(p, corrected, strict=True)
    ]


def _group(values: ArrayLike, which: str) -> NDArray[np.float64]:
    group = np.asarray(values, dtype=np.float64)
    if group.size == 0:
        raise ShapeError(f"the {which} group has no values", "both conditions need trials")
    return group
