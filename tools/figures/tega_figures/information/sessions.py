"""Run sessions of simulated people on the bench, one a condition and view, and compare the arms within people.

A session is a person who knows nothing yet, practises with object and vest, and lifts the object a few times; all lifts
count. Each condition has a session of its own, so that nothing learned under one is carried into another.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega_figures.information.bench import OFF
from tega_figures.information.compare import MARGIN as PLANT_MARGIN
from tega_figures.information.compare import Paired, null
from tega_sim.conditions import Condition
from tega_sim.lab import lab_of
from tega_sim.lift import Lift
from tega_sim.operator import RulesVersion, ViewName, draw_person
from tega_sim.plan import TrialPlan, TrialResult
from tega_sim.practice import practise
from tega_sim.world import ObjectSpec

LOST_MM = 30.0
"""An object that slides this far counts as dropped; one that never left the table counts as far."""

OUTCOMES = ("slid", "lost", "slips", "harm", "effort", "cost")
"""Way slid a lift, mm, cut at 30; share of lifts lost; slips a lift; share with deformation; mean level held, share of
full; slips, harm and effort as the person weighs them."""

MARGIN: dict[str, float] = {"slid": 3.0, "lost": 0.1, **PLANT_MARGIN}
"""A sham is null where every interval lies within this; 3 mm is the least way that counts as a slip."""


class LiftOutcome(NamedTuple):
    """Outcome of one lift; numbers as in :class:`tega_sim.plan.TrialResult`."""

    slid_mm: float
    success: bool
    dropped: bool
    slips: int
    deformations: int
    mean_level: float
    duration_s: float


class BenchSession(msgspec.Struct, frozen=True, kw_only=True):
    """One person's session under one condition and view.

    Attributes:
        seed: Who.
        object: Name of the object.
        view: Sight of the hand while it holds.
        condition: The arm.
        rules: Version of the rules.
        people: First digits of the SHA-256 of the people's numbers and rules.
        lifts: In order.
    """

    seed: int
    object: str
    view: ViewName
    condition: Condition
    rules: RulesVersion
    people: str
    lifts: list[LiftOutcome]


def bench_session(
    seed: int,
    spec: ObjectSpec,
    *,
    view: ViewName,
    condition: Condition,
    n_lifts: int,
    rules: RulesVersion = 2,
    **more: object,
) -> BenchSession:
    """Let a person who knows nothing yet practise and lift an object some times.

    Args:
        seed: Who.
        spec: What is lifted.
        view: Sight of the hand while it holds.
        condition: The arm.
        n_lifts: How often.
        rules: Version of the rules.
        more: Further attributes of :class:`tega_sim.plan.TrialPlan`.
    """
    plan = TrialPlan.checked(
        {
            "object": spec.name,
            "spec": spec,
            "condition": condition,
            "seed": seed,
            "view": view,
            "rules": rules,
            **more,
        }
    )
    lab = lab_of(seed, plan.preset, plan.settings, plan.shear)
    mind = lab.person(plan)
    practise(lab, plan, mind)
    lifts, fatigue = [], 0.0
    for number in range(n_lifts):
        run = Lift(lab, plan, mind, number, fatigue=fatigue)
        run.go(real_time=False, observer=None, stop=lambda: False, paused=lambda: False)
        fatigue = run.fatigue
        lifts.append(lift_outcome(run.result(run.end_s)))
    return BenchSession(
        seed=seed,
        object=spec.name,
        view=view,
        condition=condition,
        rules=rules,
        people=lab.digest(rules),
        lifts=lifts,
    )


def lift_outcome(found: TrialResult) -> LiftOutcome:
    """Return what is kept of a lift."""
    gone = found.drops > 0 or found.lift_off_s is None
    return LiftOutcome(
        round(LOST_MM if gone else min(1e3 * found.slid_m, LOST_MM), 3),
        found.success,
        found.drops > 0,
        found.slips,
        found.deformations,
        round(found.mean_level, 4),
        round(found.duration_s, 2),
    )


def outcomes(session: BenchSession) -> list[float]:
    """Return a session's means over its lifts, in the order of :data:`OUTCOMES`."""
    grip = draw_person(session.seed).grip
    rows = [
        (one.slid_mm, not one.success, one.slips, one.deformations > 0, one.mean_level / 5)
        for one in session.lifts
    ]
    slid, lost, slips, harm, effort = np.mean(rows, axis=0).tolist()
    return [slid, lost, slips, harm, effort, slips + grip.harm_cost * harm + grip.effort_cost * effort]


def arm_rows(
    sessions: Sequence[BenchSession], *, view: ViewName, condition: Condition, name: str
) -> dict[int, list[float]]:
    """Return outcomes by person under one condition, view and object."""
    return {
        one.seed: outcomes(one)
        for one in sessions
        if (one.view, one.condition, one.object) == (view, condition, name)
    }


def pairs(
    sessions: Sequence[BenchSession], *, view: ViewName, condition: Condition, name: str
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return outcomes under a condition, and without a vest, of the people who were run under both; a row a person."""
    told, off = (arm_rows(sessions, view=view, condition=one, name=name) for one in (condition, OFF))
    people = sorted(told.keys() & off.keys())
    return np.array([told[seed] for seed in people]), np.array([off[seed] for seed in people])


def verdict(found: dict[str, Paired]) -> str:
    """Return what an arm's differences say: ``null``, ``helps``, ``harms`` or ``not told apart``.

    ``helps``: it slid less and deformation did not rise. ``null``: every interval within its margin.
    """
    if null(found, MARGIN):
        return "null"
    if found["slid"].high < 0 and found["harm"].low <= 0:
        return "helps"
    if found["slid"].low > 0 or found["harm"].low > 0:
        return "harms"
    return "not told apart"
