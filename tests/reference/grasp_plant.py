"""A grasp in one dimension, to close the loop around a simulated operator in some milliseconds.

Closure follows excitation; an object needs one closure and is harmed above another. Sizes mean nothing: it has no hand,
no EMG and no fingers.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple, Protocol

from tega.haptics import MotorLevels, intensity, vest_frame
from tega.sim.seams import Act, Percept, WorldTruth

__all__ = ["Grasp", "Outcome", "grasp"]

HELD = frozenset({"lift", "hold", "place"})


class Outcome(NamedTuple):
    """What one trial came to."""

    slips: int
    deformed: bool
    dropped: bool
    highest_m: float
    acts: list[Act]


class Grasp(NamedTuple):
    """The object: closure it needs and closure that harms it, levels; width, metres."""

    need: float = 2.4
    harm: float = 3.6
    width_m: float = 0.07


class Actor(Protocol):
    """Anything that acts."""

    def begin(self, name: str, *, width_m: float, trial: int = 0, rest_s: float = 60.0) -> None: ...

    def act(self, percept: Percept) -> Act: ...


def grasp(
    actor: Actor,
    vest: Callable[[float, MotorLevels], MotorLevels | None] | None,
    *,
    item: Grasp | None = None,
    trial: int = 0,
    seconds: float = 20.0,
    full_effort: float = 0.7,
) -> Outcome:
    """Let an operator try once."""
    item = item or Grasp()
    actor.begin("object", width_m=item.width_m, trial=trial)
    closure, height_m, slip_m, slip_m_s, left_behind_m = 1.0, 0.0, 0.0, 0.0, 0.1
    lifted = dropped = slipping = deformed = False
    slips, highest_m = 0, 0.0
    made, acts = vest_frame([0.0] * 4, [0.0] * 4), list[Act]()
    for tick in range(round(100 * seconds)):
        t_s = tick / 100
        grip = max(closure - 1.5, 0.0)
        narrower_m = item.width_m * 0.1 * max(closure - item.harm, 0.0)
        if tick % 3 == 0:
            percent = intensity(grip / 3, 1.0)
            made = vest_frame([percent] * 4, [percent] * 4)
        force = (grip,) * 4
        scene = WorldTruth(
            t_s, height_m, lifted, force, slip_m, slip_m_s, narrower_m, 0.0, dropped, left_behind_m
        )
        act = actor.act(Percept(t_s, scene, None if vest is None else vest(t_s, made), closure))
        acts.append(act)
        if act.phase == "done":
            break
        asked = min(max(4 * act.excitation / full_effort + 0.5, 1.0), 5.0)
        closure += (asked - closure) * -math.expm1(-0.01 / 0.25)
        missing, hand_m, slip_m_s = item.need - closure, act.forearm_m[0], 0.0
        if act.phase not in HELD or dropped or grip == 0:
            dropped = dropped or (lifted and height_m > 0.02)
            lifted, height_m = False, 0.0
        elif not lifted:
            left_behind_m = hand_m
            if missing < 0.5 and 0.001 < hand_m < 0.02:
                lifted, left_behind_m, slip_m = True, 0.0, 0.0
        else:
            slip_m_s = 0.06 * max(missing, 0.0)
            slip_m += 0.01 * slip_m_s
            height_m = max(hand_m - slip_m, 0.0)
            if slip_m > 0.05:
                dropped, lifted, height_m = True, False, 0.0
        slips += slip_m_s > 0.005 and not slipping
        slipping = slip_m_s > 0.005
        deformed = deformed or narrower_m > 0.04 * item.width_m
        highest_m = max(highest_m, height_m)
    return Outcome(slips, deformed, dropped, highest_m, acts)
