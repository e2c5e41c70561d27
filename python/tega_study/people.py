"""Compare conditions person by person: tests about other people, or about these trials.

Trials of one person are more alike than trials of two, and people differ in what feedback does to them. A test that
forgets either finds effects that are not there. Those about people take a person's means as the data.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega.runtime.lifecycle import scipy_stats, statsmodels
from tega_study.rank import CONFIDENCE, rank_sum_counts

FLIPS_UP_TO = 24
DRAWS = 99_999
EXCHANGES = 19_999
_EPS = 1e-9
LEAST_ERROR = 1e-8
"""Below this, what differs is the rounding of equal numbers, and no error to judge by."""


class Ratio(NamedTuple):
    """Ratio of the first condition to the second with its 95 % interval, t and two-sided p."""

    ratio: float
    low: float
    high: float
    t: float
    p: float


class CrossOver(NamedTuple):
    """A comparison with the order of conditions taken out (Hills and Armitage 1979).

    ``effect`` is the first condition less the second, ``period`` likewise; ``t`` and two-sided ``p`` are the
    effect's.
    """

    effect: float
    period: float
    t: float
    p: float


def sign_flip(differences: ArrayLike) -> float:
    """Return the two-sided p of the mean of paired differences over all changes of their signs.

    Exact up to 24 people; beyond, 99,999 random changes and the one that is there.

    Example:
        >>> sign_flip([-1.0, -2.0, -1.5, -3.0, -2.5, -1.0])
        0.03125
    """
    values = np.asarray(differences, dtype=np.float64)
    seen = abs(values.sum()) - _EPS
    if seen <= 0:
        return 1.0
    if len(values) <= FLIPS_UP_TO:
        half = len(values) // 2
        some, others = (np.sort(_all_signs(part)) for part in (values[:half], values[half:]))
        # As many sums are as far below as above: each has its mirror image.
        above = some.size * others.size - int(np.searchsorted(others, seen - some, side="left").sum())
        return float(2 * above / 2 ** len(values))
    signs = np.random.default_rng(0).integers(0, 2, (DRAWS, len(values))) * 2 - 1
    return float((1 + np.sum(np.abs(signs @ values) >= seen)) / (DRAWS + 1))


def _all_signs(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sums of the values under all changes of their signs, float64 (2 ** n,)."""
    sums = np.zeros(1)
    for value in values:
        sums = np.concatenate([sums + value, sums - value])
    return sums


def ratio_of_means(first: ArrayLike, second: ArrayLike) -> Ratio | None:
    """Compare counts as a ratio of means, people as clusters.

    In a balanced design this is what Poisson GEE gives, in closed form, with the bias-reduced standard error
    (robust times n / (n - 1)); t with n - 1 degrees of freedom replaces its z, which rejects a true null four
    times too often with six people. ``None`` where a condition has no event, or everybody is the same.
    """
    a, b = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    n = len(a)
    if n < 2 or a.sum() <= 0 or b.sum() <= 0:
        return None
    off = a / a.mean() - b / b.mean()
    se = math.sqrt(float(np.sum(off**2))) / n * n / (n - 1)
    return ratio_by_t(math.log(a.sum() / b.sum()), se, n - 1)


def paired_log_ratio(first: ArrayLike, second: ArrayLike) -> Ratio | None:
    """Compare each person's mean logarithm under both conditions: a paired t, given as a ratio.

    A mixed model with a random intercept rejects a true null in a quarter of all studies of this size, and one
    with a random slope does not converge; this keeps its level, with the same estimate in a balanced design.
    """
    off = np.asarray(first, dtype=np.float64) - np.asarray(second, dtype=np.float64)
    if len(off) < 2:
        return None
    return ratio_by_t(float(off.mean()), float(off.std(ddof=1)) / math.sqrt(len(off)), len(off) - 1)


def ratio_by_t(log_ratio: float, se: float, df: int) -> Ratio | None:
    """Return a ratio with its interval and p by Student's t; ``None`` without an error to judge by."""
    if se < LEAST_ERROR:  # nobody differs from anybody: there is no error to judge by
        return None
    t_of = scipy_stats().t
    reach = _t_reach(df) * se
    t = log_ratio / se
    p = 2 * float(t_of.sf(abs(t), df))
    return Ratio(math.exp(log_ratio), math.exp(log_ratio - reach), math.exp(log_ratio + reach), t, p)


@cache
def _t_reach(df: int) -> float:
    """Return how many standard errors the interval reaches; cached, as the planner asks thousands of times."""
    return float(scipy_stats().t.ppf(0.5 + CONFIDENCE / 2, df))


def within_person(groups: Sequence[tuple[ArrayLike, ArrayLike]]) -> float:
    """Return the two-sided p over all exchanges of conditions among each person's own trials.

    It is not about other people, and takes trials as exchangeable: learning and tiring are not allowed for.
    Exact for whole numbers, else 19,999 random exchanges and the one that is there. ``groups`` has each
    person's values under the first and under the second condition.
    """
    pooled = [np.concatenate([np.asarray(a, float), np.asarray(b, float)]) for a, b in groups]
    sizes = [np.size(a) for a, _ in groups]
    seen = sum(float(np.sum(a)) for a, _ in groups)
    expected = sum(size * float(values.mean()) for size, values in zip(sizes, pooled, strict=True))
    off = abs(seen - expected) - _EPS
    whole = all(np.all(values == np.rint(values)) and np.all(values >= 0) for values in pooled)
    if whole and sum(float(values.sum()) for values in pooled) <= 20_000:
        ways = np.ones(1)
        for values, size in zip(pooled, sizes, strict=True):
            counts = rank_sum_counts(values.astype(int).tolist(), size)
            ways = np.convolve(ways, counts / counts.sum())
        return float(min(1.0, ways[np.abs(np.arange(len(ways)) - expected) >= off].sum()))
    random = np.random.default_rng(0)
    sums = np.zeros(EXCHANGES)
    for values, size in zip(pooled, sizes, strict=True):
        drawn: NDArray[np.float64] = random.permuted(np.tile(values, (EXCHANGES, 1)), axis=1)
        sums += drawn[:, :size].sum(axis=1)
    return float((1 + np.sum(np.abs(sums - expected) >= off)) / (EXCHANGES + 1))


def cross_over(first: ArrayLike, second: ArrayLike, began_with_first: ArrayLike) -> CrossOver | None:
    """Compare two conditions with the effect of their order taken out.

    ``None`` unless at least two people began with each and they are not all the same.
    """
    a, b = np.asarray(first, float), np.asarray(second, float)
    began = np.asarray(began_with_first, bool)
    if began.sum() < 2 or (~began).sum() < 2:
        return None
    period = np.where(began, a - b, b - a)  # first period less second
    if max(period[began].std(), period[~began].std()) < LEAST_ERROR:
        return None
    test = scipy_stats().ttest_ind(period[began], period[~began])
    ahead, behind = float(period[began].mean()), float(period[~began].mean())
    return CrossOver((ahead - behind) / 2, (ahead + behind) / 2, float(test.statistic), float(test.pvalue))


def adjusted_ratio(
    values: ArrayLike, haptic: ArrayLike, place: ArrayLike, person: ArrayLike, *, counts: bool
) -> Ratio | None:
    """Compare conditions by regression, with what drifts over the session taken out.

    Generalised estimating equations (statsmodels), people as clusters, exchangeable trials within them;
    Poisson for counts, a normal law for logarithms of times. They need only the mean to be right:
    overdispersion goes into the standard error, the bias-reduced one, with t on n - 1 degrees of freedom.
    statsmodels has no frequentist mixed model for counts.

    Arrays are by trial. ``values`` are counts, or times in seconds; ``haptic`` marks the first condition. The
    logarithm of ``place`` in the session is the covariate, since learning is fast at first. ``None`` with
    fewer than three people, where a condition has no event, or where nothing converged.
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
    if not found.converged or not LEAST_ERROR < se < 20:
        return None
    return ratio_by_t(b, se, n - 1)
