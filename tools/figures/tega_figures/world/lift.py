"""A scripted lift: reach, close to one level, lift 0.2 m, hold. The yardstick of the checks; no operator in it."""

from __future__ import annotations

from typing import Final, NamedTuple

from tega.hand.mjcf import FULL_DUTY_NM
from tega_sim.score import TrialScorer
from tega_sim.seams import WorldTruth
from tega_sim.world.objects import ObjectSpec
from tega_sim.world.poses import hand_controller
from tega_sim.world.world import World

__all__ = ["LIFT_M", "LiftResult", "lift"]

LIFT_M: Final = 0.2
_TICK_S: Final = 3e-3
# What the hand does until when: level (0: the one asked for), height, distance back.
_PLAN: Final = ((1.6, 1, 0.0, 0.0), (4.0, 0, 0.0, 0.0), (5.6, 0, LIFT_M, 0.0))


class LiftResult(NamedTuple):
    """What came of a lift, at its end.

    Attributes:
        held: Whether the object was up and not dropped.
        height_m: Of the object over where it stood.
        slips: How many there were, as a trial's score counts them (:class:`tega_sim.score.TrialScorer`).
        narrowing_m: Largest deformation.
        lift_off_s: When the object left the table; ``None``: it never did.
        trace: What was so every 3 ms.
    """

    held: bool
    height_m: float
    slip_m: float
    slips: int
    narrowing_m: float
    damage_m: float
    lift_off_s: float | None
    trace: tuple[WorldTruth, ...]


def lift(spec: ObjectSpec | str, level: int, *, hold_s: float = 2.0) -> LiftResult:
    """Lift an object at one closure level, 2 to 5, and hold it for ``hold_s`` after the hand is up."""
    world, controller = World(spec, start_m=(0.0, 0.12)), hand_controller()
    trace: list[WorldTruth] = []
    scorer = TrialScorer(world.spec.harm_m)
    tick = 0
    for until_s, wanted, height_m, back_m in (*_PLAN, (_PLAN[-1][0] + hold_s, 0, LIFT_M, 0.0)):
        world.set_forearm((height_m, back_m))
        while tick * _TICK_S < until_s - 1e-9:
            torques = FULL_DUTY_NM * controller.step(world.angles_rad, wanted or level)
            tick += 1
            world.set_torques(torques)
            world.advance_to(tick * _TICK_S)
            trace.append(world.truth())
            scorer.take(world.t_s, trace[-1], placing=False)
    scorer.close()
    end = trace[-1]
    lift_off = next((truth.t_s for truth in trace if truth.lift_off), None)
    return LiftResult(
        held=end.lift_off and not end.dropped and end.object_height_m > LIFT_M / 2,
        height_m=end.object_height_m,
        slip_m=end.slip_m,
        slips=scorer.count("slip"),
        narrowing_m=max(truth.deformation_m for truth in trace),
        damage_m=end.damage_m,
        lift_off_s=lift_off,
        trace=tuple(trace),
    )
