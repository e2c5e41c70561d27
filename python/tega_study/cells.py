"""Average the trials of each object under each condition, as the paper's Table I does."""

from __future__ import annotations

import math
from collections.abc import Sequence

import msgspec
import numpy as np

from tega_study.counts import clopper_pearson, dispersion
from tega_study.trials import Trial


class Cell(msgspec.Struct, frozen=True, kw_only=True):
    """One object under one condition: what Table I prints, and from which trials.

    Means and standard deviations are over trials, the latter ``None`` below two.

    Attributes:
        trials: Ids of the trials, which name their events.
        duration_success_s: Mean over the trials that succeeded: a dropped object ends a trial early.
        slips_dispersion: Variance over mean of the slips; 1 for Poisson.
        successes: Trials that succeeded.
        success_low: Lower end of the exact 95 % interval of the share.
        success_high: Upper end.
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
    for name in objects:
        for condition in conditions:
            mine = [t for t in trials if t.counts and (t.object, t.condition) == (name, condition)]
            durations = [t.duration_s for t in mine if t.duration_s is not None]
            n_good = sum(t.success for t in mine)
            low, high = clopper_pearson(n_good, len(mine)) if mine else (0.0, 1.0)
            cells.append(
                Cell(
                    object=name,
                    condition=condition,
                    people=len({t.participant for t in mine}),
                    trials=tuple(t.id for t in mine),
                    duration_s=_mean(durations),
                    duration_sd_s=_sd(durations),
                    duration_success_s=_mean(
                        [t.duration_s for t in mine if t.success and t.duration_s is not None]
                    ),
                    slips=_mean([t.slips for t in mine]),
                    slips_sd=_sd([t.slips for t in mine]),
                    slips_dispersion=_finite(dispersion([t.slips for t in mine])),
                    deformations=_mean([t.deformations for t in mine]),
                    deformations_sd=_sd([t.deformations for t in mine]),
                    drops=_mean([t.drops for t in mine]),
                    successes=n_good,
                    success_low=low,
                    success_high=high,
                )
            )
    return cells


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if len(values) else None


def _sd(values: Sequence[float]) -> float | None:
    return float(np.std(values, ddof=1)) if len(values) > 1 else None


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
