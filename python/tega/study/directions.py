"""Which way the paper's differences go, and whether a study's go the same way."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import msgspec
import numpy as np

from tega.study.packages import scipy_stats
from tega.study.paper import PAPER_OBJECTS, PAPER_TABLE_1
from tega.study.trials import Trial

__all__ = ["Direction", "Verdict", "directions"]

Verdict = Literal["as printed", "opposite", "not told apart", "no data"]


class Direction(msgspec.Struct, frozen=True, kw_only=True):
    """One difference that the paper prints, and the study's.

    Attributes:
        metric: ``duration_s``, ``slips``, ``deformations`` or ``success``.
        object: What was lifted.
        paper_first: What the paper prints with touch.
        paper_second: Without.
        paper_sign: 1 where the first is more, -1 where it is less.
        people: Who did both conditions.
        first: Mean of people's means under the first condition; successes as a share.
        second: Under the second.
        difference: First less second.
        low: Lower end of its 95 % interval over people, by t; ``None`` where people are one, or all alike.
        high: Upper end.
        verdict: ``as printed`` and ``opposite`` where the interval is all on one side of 0.
    """

    metric: str
    object: str
    paper_first: str
    paper_second: str
    paper_sign: int
    people: int = 0
    first: float | None = None
    second: float | None = None
    difference: float | None = None
    low: float | None = None
    high: float | None = None
    verdict: Verdict = "no data"


def directions(trials: Sequence[Trial], conditions: tuple[str, str]) -> tuple[Direction, ...]:
    """Compare a study's differences with the paper's, for every number of its Table I that differs.

    People are the unit: each person's mean under one condition less that under the other. All trials that count
    take part, also failed ones, as in the paper.

    Args:
        trials: The study's.
        conditions: The first is compared with the second; they stand for the paper's haptic and non-haptic.
    """
    printed, reference = PAPER_TABLE_1["haptic"], PAPER_TABLE_1["non-haptic"]
    found = []
    for metric, texts in printed.items():
        for name, first, second in zip(PAPER_OBJECTS, texts, reference[metric], strict=True):
            sign = _value(first) - _value(second)
            if sign:
                asked = Direction(
                    metric=metric,
                    object=name,
                    paper_first=first,
                    paper_second=second,
                    paper_sign=1 if sign > 0 else -1,
                )
                found.append(_judged(asked, trials, conditions))
    return tuple(found)


def _value(text: str) -> float:
    part, _, whole = text.partition("/")
    return float(part) / float(whole or 1)


def _judged(asked: Direction, trials: Sequence[Trial], conditions: tuple[str, str]) -> Direction:
    sides: list[dict[str, list[float]]] = [{}, {}]
    for trial in trials:
        value = getattr(trial, asked.metric)
        if (
            trial.counts
            and trial.object == asked.object
            and trial.condition in conditions
            and value is not None
        ):
            side = sides[conditions.index(trial.condition)]
            side.setdefault(trial.participant, []).append(float(value))
    both = [person for person in sides[0] if person in sides[1]]
    if not both:
        return asked
    first, second = (np.array([np.mean(side[person]) for person in both]) for side in sides)
    off = first - second
    low = high = None
    verdict: Verdict = "not told apart"
    if len(both) > 1 and off.std() > 0:  # people all alike say nothing of how people differ
        reach = float(scipy_stats().t.ppf(0.975, len(both) - 1) * off.std(ddof=1) / len(both) ** 0.5)
        low, high = float(off.mean()) - reach, float(off.mean()) + reach
        if low > 0 or high < 0:
            verdict = "as printed" if (low > 0) == (asked.paper_sign > 0) else "opposite"
    return msgspec.structs.replace(
        asked,
        people=len(both),
        first=float(first.mean()),
        second=float(second.mean()),
        difference=float(off.mean()),
        low=low,
        high=high,
        verdict=verdict,
    )
