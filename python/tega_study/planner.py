"""Plan the next study: how many people it needs to find effects as large as this one's, by the report's own tests."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from tega_study.cells import Cell
from tega_study.power import SPREADS, PlannedTest, least_people, people_for, power_of

_RUNS = 300
"""Studies drawn for each number of people."""


class Planner(msgspec.Struct, frozen=True, kw_only=True):
    """Number of people a next study needs to find an effect on slips or deformations as large as this one's.

    Attributes:
        metric: ``slips`` or ``deformations``.
        mean: Under the first condition; ``reference`` is under the second.
        spread: Name in :data:`tega_study.power.SPREADS`.
        least: Fewest people with whom the test can be significant; ``None`` for more than are tried.
        people: For 80 % power of the report's test over people, corrected over the plan's family; ``None``
            for more than :data:`tega_study.power.MOST_PEOPLE`.
        power_at_12: Power with twelve people, one full set of orders.
        error: Two standard errors of that, at most.
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
    cells: Sequence[Cell],
    family: Sequence[str],
    conditions: tuple[str, str],
    *,
    trials: int,
    alpha: float,
) -> tuple[Planner, ...]:
    """Return sample sizes for the next study, a row for each differing count of the family and each spread.

    The next study is assumed to have the means of ``cells``. ``family`` holds ``metric:object``; of
    ``conditions`` the first is compared with the second. ``trials`` are per person, object and condition;
    ``alpha`` is two-sided.
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
