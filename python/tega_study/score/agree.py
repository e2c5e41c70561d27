"""Measure how far two accounts of the same trials agree: matched events, chance, kappa in bins, counts.

No single number is enough. Matched events depend on the tolerance, kappa on the bins, the intraclass correlation on
how much trials differ. Chance is the agreement after one account is rotated in time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from tega.runtime.lifecycle import scipy_stats, statsmodels
from tega_study.coupling import finite

_EPS = 1e-9
_TURNS = 60


class Icc(NamedTuple):
    """An intraclass correlation with its 95 % interval; NaN where it is not defined."""

    value: float
    low: float
    high: float


class Agreement(msgspec.Struct, frozen=True, kw_only=True):
    """Agreement of two accounts of the same trials, for one kind of event.

    Attributes:
        matched: Pairs within the tolerance, one to one.
        f1: ``2 matched / (n_a + n_b)``; ``None`` without any event.
        chance_f1: Mean of that when the second's events are turned round within each trial.
        delay_s: Mean of ``b`` less ``a`` over the pairs.
        kappa: Cohen's, in bins of a second, all trials together; ``None`` where it is not defined.
        icc: ICC(A,1) of the counts by trial, with its 95 % interval.
    """

    kind: str
    a: str
    b: str
    trials: int
    n_a: int
    n_b: int
    matched: int
    f1: float | None
    chance_f1: float | None
    tolerance_s: float
    delay_s: float | None
    delay_sd_s: float | None
    kappa: float | None
    icc: float | None
    icc_low: float | None
    icc_high: float | None
    note: str = ""


def match_events(a: Sequence[float], b: Sequence[float], *, tolerance_s: float) -> list[tuple[int, int]]:
    """Pair events one to one: as many pairs as there can be, and among these the least time apart.

    Places in both, in the order of the first.

    Example:
        >>> match_events([1.0, 1.4], [1.35, 1.9], tolerance_s=0.5)
        [(0, 0), (1, 1)]
    """
    if not len(a) or not len(b):
        return []
    from scipy.optimize import linear_sum_assignment

    apart = np.abs(np.subtract.outer(np.asarray(a, float), np.asarray(b, float)))
    allowed = apart <= tolerance_s + _EPS
    rows, columns = linear_sum_assignment(np.where(allowed, apart - 1e6, 0.0))
    return [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if allowed[i, j]]


def kappa(
    a: Sequence[Sequence[float]],
    b: Sequence[Sequence[float]],
    lengths_s: Sequence[float],
    *,
    bin_s: float = 1.0,
) -> float | None:
    """Return Cohen's kappa of bins with an event against bins without, all trials together.

    ``a`` and ``b`` have each account's times in each trial; an event belongs to bin ``floor(t / bin_s)``.
    ``None`` where both agree by chance alone, as when nothing happens.
    """
    table = np.zeros((2, 2))
    for first, second, length_s in zip(a, b, lengths_s, strict=True):
        n = max(1, math.ceil(length_s / bin_s - _EPS))
        marks = np.zeros((2, n), dtype=int)
        for row, times in enumerate((first, second)):
            for t_s in times:
                marks[row, min(n - 1, int(t_s / bin_s + _EPS))] = 1
        np.add.at(table, (marks[0], marks[1]), 1)
    if np.count_nonzero(table) == 1 and np.trace(table):
        return None
    return float(statsmodels("stats.inter_rater").cohens_kappa(table, return_results=False))


def icc(counts: Sequence[Sequence[float]]) -> Icc:
    """Return ICC(A,1), absolute agreement of single raters (columns), two-way (McGraw and Wong 1996)."""
    table = np.asarray(counts, dtype=np.float64)
    nothing = Icc(math.nan, math.nan, math.nan)
    if len(table) < 2 or table.shape[1] < 2:
        return nothing
    n, k = table.shape
    mean = table.mean()
    msr = k * float(((table.mean(axis=1) - mean) ** 2).sum()) / (n - 1)
    msc = n * float(((table.mean(axis=0) - mean) ** 2).sum()) / (k - 1)
    rest = table - table.mean(axis=1, keepdims=True) - table.mean(axis=0) + mean
    mse = float((rest**2).sum()) / ((n - 1) * (k - 1))
    below = msr + (k - 1) * mse + k * (msc - mse) / n
    if below < _EPS:
        return nothing
    rho = (msr - mse) / below
    if mse < _EPS:
        return Icc(rho, math.nan, math.nan)
    stats = scipy_stats()
    f = msc / mse
    level = n * (1 + (k - 1) * rho) - k * rho
    v = (k - 1) * (n - 1) * (k * rho * f + level) ** 2 / ((n - 1) * (k * rho * f) ** 2 + level**2)
    up, down = float(stats.f.ppf(0.975, n - 1, v)), float(stats.f.ppf(0.975, v, n - 1))
    across = k * msc + (k * n - k - n) * mse
    low = n * (msr - up * mse) / (up * across + n * msr)
    high = n * (down * msr - mse) / (across + n * down * msr)
    return Icc(rho, low, high)


def agreement(
    kind: str,
    names: tuple[str, str],
    a: Sequence[Sequence[float]],
    b: Sequence[Sequence[float]],
    lengths_s: Sequence[float],
    *,
    tolerance_s: float,
    turns: int = _TURNS,
) -> Agreement:
    """Compare two accounts of the same trials.

    ``a`` and ``b`` have the times of each trial from its start. For the chance level, the second's events are
    turned round by so many even parts (``turns``) of a trial.
    """

    def pairs(shift: float) -> list[float]:
        found: list[float] = []
        for first, second, length_s in zip(a, b, lengths_s, strict=True):
            moved = [(t + shift * length_s) % length_s if shift else t for t in second]
            found += [moved[j] - first[i] for i, j in match_events(first, moved, tolerance_s=tolerance_s)]
        return found

    n_a, n_b = sum(map(len, a)), sum(map(len, b))
    apart = pairs(0.0)
    f1 = chance = None
    if n_a + n_b:
        f1 = 2 * len(apart) / (n_a + n_b)
        by_chance = [2 * len(pairs(turn / turns)) / (n_a + n_b) for turn in range(1, turns)]
        chance = sum(by_chance) / len(by_chance)
    same = icc([[len(first), len(second)] for first, second in zip(a, b, strict=True)])
    return Agreement(
        kind=kind,
        a=names[0],
        b=names[1],
        trials=len(lengths_s),
        n_a=n_a,
        n_b=n_b,
        matched=len(apart),
        f1=f1,
        chance_f1=chance,
        tolerance_s=tolerance_s,
        delay_s=float(np.mean(apart)) if apart else None,
        delay_sd_s=float(np.std(apart, ddof=1)) if len(apart) > 1 else None,
        kappa=kappa(a, b, lengths_s) if lengths_s else None,
        icc=finite(same.value),
        icc_low=finite(same.low),
        icc_high=finite(same.high),
    )
