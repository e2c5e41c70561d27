"""Measure each outcome's difference between two conditions, with its interval over people."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np

from tega.runtime.lifecycle import scipy_stats
from tega_study.trials import Trial

METRICS = ("duration_s", "slips", "deformations", "success")


class OutcomeDifference(msgspec.Struct, frozen=True, kw_only=True):
    """One metric of one object under both conditions; people are the unit.

    Attributes:
        metric: ``duration_s``, ``slips``, ``deformations`` or ``success``.
        condition: The first condition.
        people: With both conditions.
        first: Mean of people's means under the first condition; successes as a share.
        second: Under the second.
        difference: First less second.
        low: Lower end of its 95 % interval over people, by t; ``None`` where people are one, or all alike.
    """

    metric: str
    object: str
    condition: str = ""
    people: int = 0
    first: float | None = None
    second: float | None = None
    difference: float | None = None
    low: float | None = None
    high: float | None = None

    @property
    def apart(self) -> bool:
        """Whether the interval leaves 0 out."""
        return self.low is not None and self.high is not None and (self.low > 0 or self.high < 0)


def outcome(
    trials: Sequence[Trial], metric: str, name: str, conditions: tuple[str, str]
) -> OutcomeDifference:
    """Return the mean over people of each one's mean under the first condition less the second.

    All trials that count take part, also failed ones, as in the paper.
    """
    sides: list[dict[str, list[float]]] = [{}, {}]
    for trial in trials:
        value = getattr(trial, metric)
        if trial.counts and trial.object == name and trial.condition in conditions and value is not None:
            side = sides[conditions.index(trial.condition)]
            side.setdefault(trial.participant, []).append(float(value))
    both = [person for person in sides[0] if person in sides[1]]
    if not both:
        return OutcomeDifference(metric=metric, object=name, condition=conditions[0])
    first, second = (np.array([np.mean(side[person]) for person in both]) for side in sides)
    off = first - second
    low = high = None
    if len(both) > 1 and off.std() > 0:  # people all alike say nothing of how people differ
        reach = float(scipy_stats().t.ppf(0.975, len(both) - 1) * off.std(ddof=1) / len(both) ** 0.5)
        low, high = float(off.mean()) - reach, float(off.mean()) + reach
    return OutcomeDifference(
        metric=metric,
        object=name,
        condition=conditions[0],
        people=len(both),
        first=float(first.mean()),
        second=float(second.mean()),
        difference=float(off.mean()),
        low=low,
        high=high,
    )


def outcomes(
    trials: Sequence[Trial], objects: Sequence[str], conditions: tuple[str, str]
) -> tuple[OutcomeDifference, ...]:
    """Return every metric of every object that at least one person lifted under both conditions."""
    found = (outcome(trials, metric, name, conditions) for metric in METRICS for name in objects)
    return tuple(one for one in found if one.people)
