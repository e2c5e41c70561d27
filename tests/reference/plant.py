"""Simulate a grasp in one dimension, to close the loop around a simulated operator in some milliseconds.

Closure follows excitation; an object needs one closure and is harmed above another. Sizes mean nothing: it has no hand,
no EMG and no fingers.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import msgspec

from tega.haptics import MotorLevels, intensity, vest_frame
from tega_sim.operator import KeyboardOperator, Operator, PersonNumbers, ScriptedOperator, typical_person
from tega_sim.seams import Act, Percept, WorldTruth

# Lag of the closure behind the muscles, and speed of the slide for each level that is missing.
HAND_S, SLIP_M_S_PER_LEVEL = 0.25, 0.06
# Levels over the closure that harms, where narrowing counts as a deformation: 4 % of the width.
DEFORMED_LEVELS = 0.4
# Share of its width by which an object is narrowed for each level over the closure that harms it.
GIVES_PER_LEVEL = 0.1
# Closure at which the fingers touch, and excitation that closes the hand fully.
TOUCH, FULL_EFFORT = 1.5, 0.7


def with_(who: PersonNumbers, section: str, **values: float) -> PersonNumbers:
    return msgspec.structs.replace(who, **{section: msgspec.structs.replace(getattr(who, section), **values)})


EXACT = with_(typical_person(), "motor", aim_sd=0.0, aim_floor=0.0, effort_sd=0.0)
"""A typical person whose muscles do what they are told."""


class GraspOutcome(NamedTuple):
    """Outcome of one trial; ``slips`` are the times it began to slide faster than 5 mm/s."""

    slips: int
    deformed: bool
    dropped: bool
    highest_m: float
    acts: list[Act]


class Grasp(NamedTuple):
    """Object of a grasp, with the closures that it needs and that harm it, levels."""

    need: float = 2.4
    harm: float = 3.6
    width_m: float = 0.07

    def narrower_m(self, closure: float) -> float:
        return self.width_m * GIVES_PER_LEVEL * max(closure - self.harm, 0.0)

    @property
    def bears_m(self) -> float:
        """Narrowing beyond which it counts as deformed, metres."""
        return self.narrower_m(self.harm + DEFORMED_LEVELS)


def told_frame(closure: float) -> MotorLevels:
    percent = intensity(max(closure - TOUCH, 0.0) / 3, 1.0)
    return vest_frame([percent] * 4, [percent] * 4)


def grasp(
    actor: Operator | ScriptedOperator | KeyboardOperator,
    vest: Callable[[float, MotorLevels], MotorLevels | None] | None,
    *,
    item: Grasp | None = None,
    trial: int = 0,
    seconds: float = 20.0,
) -> GraspOutcome:
    """Let an operator try once; ``vest`` turns the time and the frame that tells the grip into the one that is worn."""
    item = item or Grasp()
    if isinstance(actor, Operator):
        actor.bears_m = item.bears_m
    actor.begin("object", width_m=item.width_m, trial=trial)
    closure, height_m, slip_m, slip_m_s, left_behind_m = 1.0, 0.0, 0.0, 0.0, 0.1
    lifted = dropped = slipping = deformed = False
    slips, highest_m = 0, 0.0
    made, acts = told_frame(closure), list[Act]()
    for tick in range(round(100 * seconds)):
        t_s = tick / 100
        grip = max(closure - TOUCH, 0.0)
        narrower_m = item.narrower_m(closure)
        if tick % 3 == 0:
            made = told_frame(closure)
        force = (grip,) * 4
        scene = WorldTruth(
            t_s, height_m, lifted, force, slip_m, slip_m_s, narrower_m, 0.0, dropped, left_behind_m
        )
        act = actor.act(Percept(t_s, scene, None if vest is None else vest(t_s, made), closure))
        acts.append(act)
        if act.phase == "done":
            break
        requested = min(max(4 * act.excitation / FULL_EFFORT + 0.5, 1.0), 5.0)
        closure += (requested - closure) * -math.expm1(-0.01 / HAND_S)
        missing, hand_m, slip_m_s = item.need - closure, act.forearm_m[0], 0.0
        if act.phase not in {"lift", "hold", "place"} or dropped or grip == 0:
            dropped = dropped or (lifted and height_m > 0.02)
            lifted, height_m = False, 0.0
        elif not lifted:
            left_behind_m = hand_m
            if missing < 0.5 and 0.001 < hand_m < 0.02:
                lifted, left_behind_m, slip_m = True, 0.0, 0.0
        else:
            slip_m_s = SLIP_M_S_PER_LEVEL * max(missing, 0.0)
            slip_m += 0.01 * slip_m_s
            height_m = max(hand_m - slip_m, 0.0)
            if slip_m > 0.05:
                dropped, lifted, height_m = True, False, 0.0
        slips += slip_m_s > 0.005 and not slipping
        slipping = slip_m_s > 0.005
        deformed = deformed or narrower_m > item.bears_m
        highest_m = max(highest_m, height_m)
    return GraspOutcome(slips, deformed, dropped, highest_m, acts)
