"""Compare success rates and totals of events, each trial a sample of its own."""

from __future__ import annotations

import math
import warnings
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from tega.runtime.lifecycle import scipy_stats, statsmodels


class Shares(NamedTuple):
    """Two success rates compared; all of it treats trials as independent.

    Two-sided p of Fisher's exact test and of Boschloo's, which is never less powerful; the first share less
    the second, with Newcombe's 95 % interval.
    """

    fisher: float
    boschloo: float
    difference: float
    low: float
    high: float


def clopper_pearson(k: int, n: int) -> tuple[float, float]:
    """Return the exact confidence interval of a share of ``k`` in ``n``.

    Example:
        >>> low, high = clopper_pearson(5, 5)
        >>> round(low, 3), high
        (0.478, 1.0)
    """
    found = scipy_stats().binomtest(k, n).proportion_ci(method="exact")
    return float(found.low), float(found.high)


def shares(k1: int, n1: int, k2: int, n2: int) -> Shares:
    """Compare ``k1`` of ``n1`` with ``k2`` of ``n2``."""
    stats = scipy_stats()
    table = [[k1, n1 - k1], [k2, n2 - k2]]
    low, high = statsmodels("stats.proportion").confint_proportions_2indep(
        k1, n1, k2, n2, method="newcomb", compare="diff"
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # SciPy divides 0 by 0 where both shares are 0 or 1
        boschloo = float(stats.boschloo_exact(table).pvalue)
    boschloo = 1.0 if math.isnan(boschloo) else min(1.0, boschloo)
    return Shares(float(stats.fisher_exact(table)[1]), boschloo, k1 / n1 - k2 / n2, float(low), float(high))


def poisson_rates(k1: int, k2: int) -> tuple[float, float, float, float]:
    """Compare two totals of events under equal exposure: two-sided p, ratio and its exact 95 % interval.

    Conditional on the sum. Too sure of itself where counts vary more than Poisson's; see :func:`dispersion`.
    """
    test = scipy_stats().binomtest(k1, k1 + k2, 0.5)
    low, high = (
        float(end / (1 - end)) if end < 1 else math.inf for end in test.proportion_ci(method="exact")
    )
    return float(test.pvalue), k1 / k2 if k2 else math.inf, low, high


def dispersion(counts: ArrayLike) -> float | None:
    """Return variance over mean: 1 for Poisson counts, ``None`` where nothing was counted or there is one count."""
    values = np.asarray(counts, float)
    if len(values) < 2 or values.mean() == 0:
        return None
    return float(values.var(ddof=1) / values.mean())
