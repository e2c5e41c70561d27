"""Compute the power of the report's own tests over people, run on drawn studies, and plan the next study.

Counts are negative binomial with the mean ``m * exp(b_i + s_i * haptic)``, scaled so that the given means are the
marginal ones; people differ in level (``b``) and in effect (``s``). Times are log-normal; a person's level cancels.
Each drawn study goes through the report's test (:func:`tega_study.compare.people_p`) and its correction
(:func:`tega_study.rank.holm`) over all tests of the plan.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.errors import InvalidValueError
from tega_study.compare import people_p
from tega_study.difference import Cell
from tega_study.rank import holm


class EffectSpread(NamedTuple):
    """Assumed differences between people and between trials.

    ``dispersion`` is of the counts: variance = mean + dispersion * mean². Standard deviations are of people's
    log level, log effect and log effect on the time, and of the log times of one person's trials.
    """

    dispersion: float
    sd_level: float
    sd_effect: float
    time_sd_effect: float
    time_sd: float


SPREADS = {
    "low": EffectSpread(0.0, 0.2, 0.0, 0.05, 0.15),
    "mid": EffectSpread(0.2, 0.3, 0.2, 0.10, 0.20),
    "high": EffectSpread(0.5, 0.5, 0.4, 0.15, 0.30),
}
"""Three assumptions, from hardly any differences to large ones; a pilot's variance over mean says which is nearer."""

POWER = 0.8
"""Share of studies that have to find an effect."""

MOST_PEOPLE = 24
"""Largest study that is tried: two full sets of the orders of three objects under two conditions."""


class PlannedTest(NamedTuple):
    """One test of the plan's family, with the means that are assumed.

    ``metric`` is ``duration_s``, or a count. ``mean`` is a trial's under the first condition, ``reference``
    under the second.
    """

    metric: str
    mean: float
    reference: float


class Power(NamedTuple):
    """Share of drawn studies with so many people in which a test is significant after the correction.

    ``error`` is two standard errors of the simulation, at most.
    """

    people: int
    found: float
    error: float


def least_people(metric: str, *, tests: int, alpha: float = 0.05) -> int | None:
    """Return the fewest people with whom a test can be significant at all, however large the effect.

    The report's test is run on the most extreme data: every person differs in the same direction. The other tests
    are taken to find nothing, so that the correction is the strongest. ``None`` above :data:`MOST_PEOPLE`.

    Example:
        >>> least_people("slips", tests=7)
        9
    """
    for people in range(2, MOST_PEOPLE + 1):
        most = 3 + np.arange(people) * 1e-6
        p = people_p(most, np.zeros(people), counted=metric != "duration_s")
        corrected = holm([p, *[None] * (tests - 1)])[0]
        if corrected is not None and corrected < alpha:
            return people
    return None


def power_of(
    family: Sequence[PlannedTest],
    target: int = 0,
    *,
    people: int,
    trials: int = 10,
    spread: EffectSpread = SPREADS["mid"],
    alpha: float = 0.05,
    runs: int = 1000,
    seed: int = 1,
) -> Power:
    """Draw studies, and count those in which a test is significant by the report's own test and correction.

    ``family`` has all tests that are corrected together, ``target`` is the place of the one that counts. Each
    of the ``runs`` studies has 2 to 60 ``people``; ``trials`` are per person, object and condition. ``alpha``
    is two-sided.
    """
    for test in family:
        if not (0 <= test.mean < 1e4 and 0 <= test.reference < 1e4):
            raise InvalidValueError(
                f"means {test.mean} and {test.reference}: not between 0 and 10000", "give values per trial"
            )
    if not 2 <= people <= 60:
        raise InvalidValueError(f"people = {people}: not 2 to 60", "use more trials or a larger effect")
    random = np.random.default_rng([seed, people, trials])
    drawn = [_draw(test, random, people=people, trials=trials, spread=spread, runs=runs) for test in family]
    found = 0
    for run in range(runs):
        tests = [
            cache(partial(people_p, first[run], second[run], counted=test.metric != "duration_s"))
            for test, (first, second) in zip(family, drawn, strict=True)
        ]
        found += _significant(tests, target, alpha)
    return Power(people, found / runs, 1 / math.sqrt(runs))


def people_for(
    family: Sequence[PlannedTest],
    target: int = 0,
    *,
    trials: int = 10,
    spread: EffectSpread = SPREADS["mid"],
    alpha: float = 0.05,
    runs: int = 1000,
) -> Power | None:
    """Return the smallest study that finds the effect often enough; ``None`` above :data:`MOST_PEOPLE`.

    The arguments are those of :func:`power_of`, ``runs`` for each size.
    """
    low = least_people(family[target].metric, tests=len(family), alpha=alpha) or MOST_PEOPLE + 1
    best, high = None, MOST_PEOPLE
    while low <= high:  # more people find it more often
        people = (low + high) // 2
        tried = power_of(family, target, people=people, trials=trials, spread=spread, alpha=alpha, runs=runs)
        if tried.found >= POWER:
            best, high = tried, people - 1
        else:
            low = people + 1
    return best


def too_few(family: Sequence[str], *, people: int, alpha: float) -> Mapping[str, int | None]:
    """Return a plan's metrics that so few people cannot make significant, with the fewest that could."""
    metrics = dict.fromkeys(test.partition(":")[0] for test in family)
    least = {metric: least_people(metric, tests=len(family), alpha=alpha) for metric in metrics}
    return {metric: n for metric, n in least.items() if n is None or n > people}


def _draw(
    test: PlannedTest,
    random: np.random.Generator,
    *,
    people: int,
    trials: int,
    spread: EffectSpread,
    runs: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Draw each person's means under both conditions, each (runs, people); for times the mean logarithm."""
    shape = runs, people
    if test.metric == "duration_s":
        effect = random.normal(math.log(test.mean / test.reference), spread.time_sd_effect, shape)
        error = [random.normal(0, spread.time_sd / math.sqrt(trials), shape) for _ in range(2)]
        return effect + error[0], error[1]
    level = random.normal(0, spread.sd_level, shape) - spread.sd_level**2 / 2
    effect = random.normal(0, spread.sd_effect, shape) - spread.sd_effect**2 / 2
    second = _sums(random, test.reference * np.exp(level), trials, spread.dispersion)
    first = _sums(random, test.mean * np.exp(level + effect), trials, spread.dispersion)
    return first / trials, second / trials


def _sums(
    random: np.random.Generator, means: NDArray[np.float64], trials: int, dispersion: float
) -> NDArray[np.float64]:
    """Draw each person's total: the sum of negative binomials of one mean is one, of ``trials`` times the shape."""
    means = random.gamma(trials / dispersion, means * dispersion) if dispersion > 0 else means * trials
    return random.poisson(means).astype(np.float64)


def _significant(tests: Sequence[Callable[[], float | None]], target: int, alpha: float) -> bool:
    """Return whether a test is below alpha after Holm's correction; the others are run only if it depends on them."""
    p = tests[target]()
    if p is None or p >= alpha or p * len(tests) < alpha:
        return p is not None and p < alpha
    corrected = holm([one() for one in tests])[target]
    return corrected is not None and corrected < alpha


_RUNS = 300
"""Studies drawn for each number of people."""


class Planner(msgspec.Struct, frozen=True, kw_only=True):
    """Number of people a next study needs to find an effect on slips or deformations as large as this one's.

    ``mean`` is under the first condition, ``reference`` under the second. With the fewest (``least``) the test
    can be significant, with ``people`` it has 80 % power; ``None`` above :data:`MOST_PEOPLE`. ``power_at_12``
    is that of twelve people, one full set of orders, ``error`` two standard errors of it, at most.
    """

    metric: str
    object: str
    mean: float
    reference: float
    spread: str
    least: int | None
    people: int | None
    power_at_12: float
    error: float


def next_study(
    cells: Sequence[Cell], family: Sequence[str], conditions: tuple[str, str], *, trials: int, alpha: float
) -> tuple[Planner, ...]:
    """Return sample sizes for the next study, a row for each differing count of the family and each spread.

    The next study is assumed to have the means of ``cells``. ``trials`` are per person, object and condition.
    """
    of = {(cell.object, cell.condition): cell for cell in cells}
    tests = [_planned(test, of, conditions) for test in family]
    found = []
    for place, (name, test) in enumerate(zip(family, tests, strict=True)):
        if test.metric == "duration_s" or not test.mean or not test.reference or test.mean == test.reference:
            continue
        for label, spread in SPREADS.items():
            at_12 = power_of(tests, place, people=12, trials=trials, spread=spread, alpha=alpha, runs=_RUNS)
            needed = people_for(tests, place, trials=trials, spread=spread, alpha=alpha, runs=_RUNS)
            found.append(
                Planner(
                    metric=test.metric,
                    object=name.partition(":")[2],
                    mean=test.mean,
                    reference=test.reference,
                    spread=label,
                    least=least_people(test.metric, tests=len(family), alpha=alpha),
                    people=None if needed is None else needed.people,
                    power_at_12=at_12.found,
                    error=at_12.error,
                )
            )
    return tuple(found)


def _planned(test: str, of: dict[tuple[str, str], Cell], conditions: tuple[str, str]) -> PlannedTest:
    """Return a test with this study's means; without trials it finds nothing."""
    metric, _, name = test.partition(":")
    mean, reference = (getattr(of.get((name, one)), metric, None) for one in conditions)
    if mean is None or reference is None or (metric == "duration_s" and not (mean and reference)):
        return PlannedTest(metric, 1.0, 1.0)
    return PlannedTest(metric, mean, reference)
