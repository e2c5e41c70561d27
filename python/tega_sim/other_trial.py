"""Record the vest of another trial, to be replayed to a person as a sham."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from tega.haptics import MotorLevels
from tega_sim.conditions import ARMS

if TYPE_CHECKING:
    from tega_sim.lab import Lab
    from tega_sim.plan import TrialPlan


def other_trial(plan: TrialPlan) -> TrialPlan:
    """Return the trial whose vest stands in for a plan's: the same person's, with the next object.

    The vest is the real one; in the place of pulses at true slips it is the other trial's pulses.
    """
    from tega_sim.world import OBJECTS

    names = list(OBJECTS)
    name = names[(names.index(plan.object) + 1) % len(names)] if plan.object in names else names[0]
    return msgspec.structs.replace(
        plan,
        object=name,
        condition="oracle" if ARMS[plan.condition].pulses else "haptic",
        operator="scripted" if plan.operator == "scripted" else "simulated",
        mass_kg=None,
        stiffness_n_m=None,
        friction=None,
        spec=None,
    )


@lru_cache(maxsize=1)  # a practice and the lift after it are replayed the same
def other_vest(lab: Lab, plan: TrialPlan, number: int) -> list[tuple[float, MotorLevels]]:
    """Return times in seconds and frames of the vest in the other trial; who lifts there has learned nothing yet.

    Args:
        lab: The person's lab.
        plan: The trial in which it is to be replayed.
        number: Of the lift.
    """
    from tega_sim.lift import Lift
    from tega_sim.streams import Streams

    other, streams = other_trial(plan), Streams()
    person = lab.person(other)
    lift = Lift(lab, other, person, number, streams=streams)
    lift.go(real_time=False, observer=None, stop=lambda: False, paused=lambda: False)
    return [
        (t_s, MotorLevels(lift.layout, np.array(levels, np.uint8))) for t_s, *levels in streams.rows["vest"]
    ]
