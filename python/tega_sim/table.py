"""Average simulated trials by object and condition, to stand side by side."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import msgspec

from tega_sim.world.objects import variant_name

if TYPE_CHECKING:
    from tega_sim.trial import TrialResult


class Row(msgspec.Struct, frozen=True, kw_only=True):
    """One object under one condition.

    Attributes:
        object: Name of the object, with the changes of the plan.
        condition: The arm.
        n: Trials.
        success: Share of them that were lifted and held.
        slips: Mean per trial, as the others.
        deformations: Mean number of deformations.
        drops: Mean number of drops.
        duration_s: Mean duration, seconds.
        peak_force_n: Mean peak force, newtons.
    """

    object: str
    condition: str
    n: int
    success: float
    slips: float
    deformations: float
    drops: float
    duration_s: float
    peak_force_n: float


def summarise_trials(results: Sequence[TrialResult]) -> list[Row]:
    """Average trials by object and condition, in the order in which these first come."""
    groups: dict[tuple[str, str], list[TrialResult]] = {}
    for result in results:
        groups.setdefault((variant_name(result.object, result.changes), result.condition), []).append(result)
    return [
        Row(
            object=name,
            condition=condition,
            n=len(group),
            **{
                subject: sum(getattr(result, subject) for result in group) / len(group)
                for subject in Row.__struct_fields__[3:]
            },
        )
        for (name, condition), group in groups.items()
    ]
