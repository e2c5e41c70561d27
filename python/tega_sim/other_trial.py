"""Record the vest of another trial, to be replayed to a person as a sham."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from tega_sim.conditions import ARMS

if TYPE_CHECKING:
    from tega_sim.plan import TrialPlan


def other_trial(plan: TrialPlan) -> TrialPlan:
    """Return the trial that lends its vest frames to a plan: the same person, the next object.

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
