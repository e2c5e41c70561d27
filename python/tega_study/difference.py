"""Average the trials as the paper's Table I does, measure differences over people, and compare with the paper's.

The paper's objects 1 to 3 are bottle, container and bag here.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Literal

import msgspec
import numpy as np

from tega.runtime.lifecycle import scipy_stats
from tega_study.counts import clopper_pearson, dispersion
from tega_study.people import LEAST_ERROR
from tega_study.trials import Trial

PAPER_OBJECTS = ("bottle", "container", "bag")

PAPER_LABELS = {
    "duration_s": "Completion Time",
    "slips": "Slippage",
    "deformations": "Deformation",
    "success": "Success Rate",
}

PAPER_TABLE_1 = {
    "haptic": {
        # without a unit; sums of ten trials fit a 15 s window (A62)
        "duration_s": ("152.8", "177.4", "151.5"),
        "slips": ("2.8", "0.7", "0.3"),
        "deformations": ("0.0", "0.0", "0.5"),
        "success": ("5/5", "5/5", "5/5"),
    },
    "non-haptic": {
        "duration_s": ("168.5", "171.4", "160.1"),
        "slips": ("5.9", "4.2", "0.5"),
        "deformations": ("0.0", "0.0", "1.3"),
        "success": ("4/5", "4/5", "5/5"),
    },
}

PAPER_SETUP = {
    "objects": "a bottle (rigid, heavy), a box of wipes (medium), a bag of bread (light, soft)",
    "trials": "ten trials for each object and condition; success is printed as a count of five",
    "unit": "trials, each taken as a sample of its own",
    "events": "one trained observer counted visible slips and deformations",
    "time": "printed without a unit; fits the 15 s window only as sums of ten trials",
}
"""The paper's description of its set-up, by row of the report's comparison."""


METRICS = ("duration_s", "slips", "deformations", "success")


class OutcomeDifference(msgspec.Struct, frozen=True, kw_only=True):
    """One metric of one object, means of the means of people who have both conditions; successes as a share.

    ``low`` to ``high`` is the 95 % interval of ``difference``, first less second, over people, by t; ``None``
    where people are one, or all alike.
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
    if len(both) > 1 and off.std() > LEAST_ERROR:  # people all alike say nothing of how people differ
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


Verdict = Literal["as printed", "opposite", "not distinguished", "no data"]


class Direction(OutcomeDifference, frozen=True, kw_only=True):
    """One difference that the paper prints with touch and without, and the study's.

    ``paper_sign`` is 1 where the first is more, else -1. The verdict goes by the interval over people.
    """

    paper_first: str
    paper_second: str
    paper_sign: int
    verdict: Verdict = "no data"


def directions(trials: Sequence[Trial], conditions: tuple[str, str]) -> tuple[Direction, ...]:
    """Compare a study's differences with the paper's (haptic, non-haptic), for every number of Table I that differs."""
    printed, reference = PAPER_TABLE_1["haptic"], PAPER_TABLE_1["non-haptic"]
    found = []
    for metric, texts in printed.items():
        for name, first, second in zip(PAPER_OBJECTS, texts, reference[metric], strict=True):
            off = _value(first) - _value(second)
            if not off:
                continue
            seen, sign = outcome(trials, metric, name, conditions), 1 if off > 0 else -1
            verdict: Verdict = "not distinguished" if seen.people else "no data"
            if seen.apart:
                verdict = "as printed" if (seen.difference or 0.0) * sign > 0 else "opposite"
            found.append(
                Direction(
                    **msgspec.structs.asdict(seen),
                    paper_first=first,
                    paper_second=second,
                    paper_sign=sign,
                    verdict=verdict,
                )
            )
    return tuple(found)


def _value(text: str) -> float:
    part, _, whole = text.partition("/")
    return float(part) / float(whole or 1)


class Cell(msgspec.Struct, frozen=True, kw_only=True):
    """One object under one condition: what Table I prints, and from which trials (ids).

    Means and standard deviations are over trials, the latter ``None`` below two.

    Attributes:
        duration_success_s: Mean over the trials that succeeded: a dropped object ends a trial early.
        slips_dispersion: Variance over mean of the slips; 1 for Poisson.
        success_low: Lower end of the exact 95 % interval of the share.
    """

    object: str
    condition: str
    people: int
    trials: tuple[str, ...]
    duration_s: float | None
    duration_sd_s: float | None
    duration_success_s: float | None
    slips: float | None
    slips_sd: float | None
    slips_dispersion: float | None
    deformations: float | None
    deformations_sd: float | None
    drops: float | None
    successes: int
    success_low: float
    success_high: float


def cells_of(trials: Sequence[Trial], objects: Sequence[str], conditions: Sequence[str]) -> list[Cell]:
    """Average the trials that count, by object and condition."""
    cells = []
    for name, condition in product(objects, conditions):
        mine = [t for t in trials if t.counts and (t.object, t.condition) == (name, condition)]
        timed = [(t.duration_s, t.success) for t in mine if t.duration_s is not None]
        durations, slips = [t_s for t_s, _ in timed], [t.slips for t in mine]
        deformed = [t.deformations for t in mine]
        n_good = sum(t.success for t in mine)
        low, high = clopper_pearson(n_good, len(mine)) if mine else (0.0, 1.0)
        cell = Cell(
            object=name,
            condition=condition,
            people=len({t.participant for t in mine}),
            trials=tuple(t.id for t in mine),
            duration_s=_mean(durations),
            duration_sd_s=_sd(durations),
            duration_success_s=_mean([t_s for t_s, good in timed if good]),
            slips=_mean(slips),
            slips_sd=_sd(slips),
            slips_dispersion=dispersion(slips),
            deformations=_mean(deformed),
            deformations_sd=_sd(deformed),
            drops=_mean([t.drops for t in mine]),
            successes=n_good,
            success_low=low,
            success_high=high,
        )
        cells.append(cell)
    return cells


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if len(values) else None


def _sd(values: Sequence[float]) -> float | None:
    return float(np.std(values, ddof=1)) if len(values) > 1 else None
