"""Compare counts and success rates: exact intervals, dispersion, a regression that takes learning out."""

from __future__ import annotations

import math
import warnings
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from tega.runtime.scientific import scipy_stats, statsmodels
from tega_study.people import Ratio, ratio_by_t


class Shares(NamedTuple):
    """Two success rates compared; all of it treats trials as independent.

    Attributes:
        fisher: Two-sided p of Fisher's exact test.
        boschloo: p of Boschloo's test, which is never less powerful.
        difference: First share less the second.
        low: Lower end of Newcombe's 95 % interval of it; ``high`` the upper.
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
    ends = test.proportion_ci(method="exact")
    return float(test.pvalue), k1 / k2 if k2 else math.inf, _odds(float(ends.low)), _odds(float(ends.high))


def _odds(share: float) -> float:
    return share / (1 - share) if share < 1 else math.inf


def dispersion(counts: ArrayLike) -> float:
    """Return variance over mean: 1 for Poisson counts, NaN where nothing was counted or there is one count."""
    values = np.asarray(counts, float)
    if len(values) < 2 or values.mean() == 0:
        return math.nan
    return float(values.var(ddof=1) / values.mean())


def adjusted_ratio(
    values: ArrayLike, haptic: ArrayLike, place: ArrayLike, person: ArrayLike, *, counts: bool
) -> Ratio | None:
    """Compare conditions by regression, with what drifts over the session taken out.

    Generalised estimating equations (statsmodels), people as clusters, exchangeable trials within them;
    Poisson for counts, a normal law for logarithms of times. Chosen because statsmodels has no frequentist
    mixed model for counts, a mixed model for times either does not converge (random slopes, up to 12 people)
    or rejects too often (random intercept only), and an estimating equation needs only the mean to be right:
    overdispersion, as of a negative binomial, goes into the standard error. That is the bias-reduced one,
    with t on n - 1 degrees of freedom.

    Arrays are by trial. ``values`` are counts, or times in seconds; ``haptic`` marks the first condition.
    ``place`` is the trial's place in the session; its logarithm is the covariate, since learning is fast at
    first. ``None`` with fewer than three people, where a condition has no event, or where nothing converged.
    """
    y, first = np.asarray(values, float), np.asarray(haptic, bool)
    ids, cluster = np.unique(np.asarray(person), return_inverse=True)
    n = len(ids)
    if n < 3 or not first.any() or first.all() or (counts and min(y[first].sum(), y[~first].sum()) <= 0):
        return None
    if not counts and y.min() <= 0:
        return None
    api = statsmodels("api")
    drift = np.log(np.asarray(place, float))
    columns = [np.ones_like(y), first.astype(float)]
    if np.ptp(drift) > 0:
        columns.append(drift - drift.mean())
    order = np.argsort(cluster, kind="stable")
    model = api.GEE(
        (y if counts else np.log(y))[order],
        np.column_stack(columns)[order],
        groups=cluster[order],
        family=api.families.Poisson() if counts else api.families.Gaussian(),
        cov_struct=api.cov_struct.Exchangeable(),
    )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            found = model.fit(cov_type="bias_reduced")
    except (Warning, np.linalg.LinAlgError, ValueError, FloatingPointError):
        return None
    b, se = float(found.params[1]), float(found.bse[1])
    if not found.converged or not 1e-8 < se < 20:
        return None
    return ratio_by_t(b, se, n - 1)
