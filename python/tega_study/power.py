"""Estimate how many people a study needs, from assumed or pilot means (N13).

Counts: negative binomial, mean ``m * exp(b_i + s_i * haptic)`` scaled so that the given means are the marginal
ones; people differ in level (``b``) and in effect (``s``). Analysed as the report does: a paired t on log(sum +
0.5), and exact sign-flips.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tega.errors import InvalidValueError
from tega.runtime.scientific import scipy_stats

if TYPE_CHECKING:
    from numpy.typing import NDArray


class EffectSpread(NamedTuple):
    """Assumed differences between people and between trials.

    Attributes:
        dispersion: Of the counts: variance = mean + dispersion * mean².
        sd_level: Of people's log level.
        sd_effect: Of people's log effect.
    """

    dispersion: float
    sd_level: float
    sd_effect: float


SPREADS = {
    "low": EffectSpread(0.0, 0.2, 0.0),
    "mid": EffectSpread(0.2, 0.3, 0.2),
    "high": EffectSpread(0.5, 0.5, 0.4),
}
"""Three assumptions, from hardly any differences to large ones; a pilot's variance over mean says which is nearer."""

FLIPS_UP_TO = 12
MOST_PEOPLE = 60


class CountPower(NamedTuple):
    """Share of simulated studies that find the effect.

    Attributes:
        people: In each study.
        paired_t: By a paired t on log(sum + 0.5).
        sign_flip: By all changes of sign; 0 below six people at 0.05, whatever the effect.
        error: Two standard errors of the simulation, at most.
    """

    people: int
    paired_t: float
    sign_flip: float
    error: float


def count_power(
    mean: float,
    reference: float,
    *,
    people: int,
    trials: int = 10,
    spread: EffectSpread = SPREADS["mid"],
    alpha: float = 0.05,
    runs: int = 2000,
    seed: int = 1,
) -> CountPower:
    """Simulate studies of counts.

    Args:
        mean: Expected count per trial under the first condition.
        reference: Under the second.
        people: In each study, 2 to 60.
        trials: Per person and condition.
        spread: See :data:`SPREADS`.
        alpha: Two-sided.
        runs: Studies simulated.
        seed: Of the simulation.

    Raises:
        InvalidValueError: A value is out of range.
    """
    off, difference = _studies(
        mean, reference, people=people, trials=trials, spread=spread, runs=runs, seed=seed
    )
    flips = float(np.mean(_flips(difference) <= alpha + 1e-12)) if 2 / 2**people <= alpha else 0.0
    return CountPower(people, _found(off, alpha), flips, 1 / math.sqrt(runs))


def _studies(
    mean: float, reference: float, *, people: int, trials: int, spread: EffectSpread, runs: int, seed: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Draw studies; return people's differences of log sums and of sums, each (runs, people)."""
    if not (0 < mean < 1e4 and 0 < reference < 1e4):
        raise InvalidValueError(
            f"means {mean} and {reference}: not between 0 and 10000", "give counts per trial"
        )
    if not 2 <= people <= MOST_PEOPLE:
        raise InvalidValueError(
            f"people = {people}: not 2 to {MOST_PEOPLE}", "beyond, use more trials or a larger effect"
        )
    random = np.random.default_rng([seed, people, trials])
    level = random.normal(0, spread.sd_level, (runs, people)) - spread.sd_level**2 / 2
    effect = random.normal(0, spread.sd_effect, (runs, people)) - spread.sd_effect**2 / 2
    sums = [
        _sums(random, reference * np.exp(level), trials, spread.dispersion),
        _sums(random, mean * np.exp(level + effect), trials, spread.dispersion),
    ]
    return np.log(sums[1] + 0.5) - np.log(sums[0] + 0.5), sums[1] - sums[0]


def _found(off: NDArray[np.float64], alpha: float) -> float:
    """Return the share of studies in which a paired t is significant; one without any spread finds nothing."""
    people = off.shape[1]
    se = off.std(axis=1, ddof=1) / math.sqrt(people)
    limit = float(scipy_stats().t.ppf(1 - alpha / 2, people - 1))
    return float(np.mean((np.abs(off.mean(axis=1)) >= limit * se) & (se > 0)))


def _sums(
    random: np.random.Generator, means: NDArray[np.float64], trials: int, dispersion: float
) -> NDArray[np.float64]:
    """Draw each person's total: the sum of negative binomials of one mean is one, of ``trials`` times the shape."""
    means = random.gamma(trials / dispersion, means * dispersion) if dispersion > 0 else means * trials
    return random.poisson(means).astype(np.float64)


def _flips(differences: NDArray[np.float64]) -> NDArray[np.float64]:
    """Two-sided sign-flip p of each row: over half of all signs (the other half mirrors them), or 4,000 drawn ones."""
    n = differences.shape[1]
    exact = n <= FLIPS_UP_TO
    codes = np.arange(2 ** (n - 1)) if exact else np.random.default_rng(n).integers(0, 2**n, 4000)
    signs = 1.0 - 2.0 * ((codes[None, :] >> np.arange(n)[:, None]) & 1)
    seen = np.abs(differences.sum(axis=1, keepdims=True)) - 1e-9
    as_far = (np.abs(differences @ signs) >= seen).sum(axis=1)
    p: NDArray[np.float64] = as_far / codes.size if exact else (1 + as_far) / (1 + codes.size)
    return p


def people_for(
    mean: float,
    reference: float,
    *,
    power: float = 0.8,
    trials: int = 10,
    spread: EffectSpread = SPREADS["mid"],
    alpha: float = 0.05,
    most: int = 30,
    runs: int = 2000,
    seed: int = 1,
) -> tuple[int, float] | None:
    """Return the people of the smallest study whose paired t finds the effect often enough, and how often it does.

    ``None`` where ``most`` are too few.

    Arguments as in :func:`count_power`.
    """
    for people in range(2, most + 1):
        off, _ = _studies(mean, reference, people=people, trials=trials, spread=spread, runs=runs, seed=seed)
        found = _found(off, alpha)
        if found >= power:
            return people, found
    return None
