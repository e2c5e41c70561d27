"""Simulate a grasp in one dimension, to close the loop around a simulated operator in some milliseconds.

Closure follows excitation; an object needs one closure and is harmed above another. Sizes mean nothing: it has no hand,
no EMG and no fingers.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple, Protocol

import msgspec

from tega.haptics import MotorLevels, intensity, vest_frame
from tega_sim.operator import Operator, PersonNumbers, typical_person
from tega_sim.seams import Act, Percept, WorldTruth

HAND_S = 0.25
"""Lag of the closure behind the muscles, seconds."""
SLIP_M_S_PER_LEVEL = 0.06
"""Speed of the slide through the grasp for each level that is missing."""
DEFORMED_LEVELS = 0.4
"""Levels over the closure that harms, where narrowing counts as a deformation: 4 % of the width."""

TOUCH = 1.5
"""Closure at which the fingers touch, levels."""

FULL_EFFORT = 0.7
"""Excitation that closes the hand fully."""

HELD = frozenset({"lift", "hold", "place"})


def with_(who: PersonNumbers, section: str, **values: float) -> PersonNumbers:
    """Return a person with other numbers in one section."""
    return msgspec.structs.replace(who, **{section: msgspec.structs.replace(getattr(who, section), **values)})


EXACT = with_(typical_person(), "motor", aim_sd=0.0, aim_floor=0.0, effort_sd=0.0)
"""A typical person whose muscles do what they are told."""


class GraspOutcome(NamedTuple):
    """Outcome of one trial.

    Attributes:
        slips: Times it began to slide through the grasp faster than 5 mm/s.
        deformed: Whether it was narrowed by more than 4 % of its width.
        dropped: Whether it was lifted and fell.
        highest_m: How high it got, metres.
        acts: Everything that was done.
    """

    slips: int
    deformed: bool
    dropped: bool
    highest_m: float
    acts: list[Act]


GIVES_PER_LEVEL = 0.1
"""Share of its width by which an object is narrowed for each level over the closure that harms it."""


class Grasp(NamedTuple):
    """Object of a grasp.

    Attributes:
        need: Closure it needs, levels.
        harm: Closure that harms it, levels.
        width_m: Its width, metres.
    """

    need: float = 2.4
    harm: float = 3.6
    width_m: float = 0.07

    def narrower_m(self, closure: float) -> float:
        """Return by how much a closure narrows it, metres."""
        return self.width_m * GIVES_PER_LEVEL * max(closure - self.harm, 0.0)

    @property
    def bears_m(self) -> float:
        """Narrowing beyond which it counts as deformed, metres."""
        return self.narrower_m(self.harm + DEFORMED_LEVELS)


class GraspActor(Protocol):
    """Operator of the plant."""

    def begin(self, name: str, *, width_m: float, trial: int = 0, rest_s: float = 60.0) -> None:
        """Start a trial."""
        ...

    def act(self, percept: Percept) -> Act:
        """Take in a percept and return what is done."""
        ...


def told_frame(closure: float) -> MotorLevels:
    """Return the frame that tells a closure, by the law of the real vest."""
    percent = intensity(max(closure - TOUCH, 0.0) / 3, 1.0)
    return vest_frame([percent] * 4, [percent] * 4)


def grasp(
    actor: GraspActor,
    vest: Callable[[float, MotorLevels], MotorLevels | None] | None,
    *,
    item: Grasp | None = None,
    trial: int = 0,
    seconds: float = 20.0,
) -> GraspOutcome:
    """Let an operator try once.

    Args:
        actor: Who tries.
        vest: Turns the time and the frame that tells the grip into the one that is worn; ``None`` without a vest.
        item: What is lifted.
        trial: Number of the trial.
        seconds: When it ends at the latest.
    """
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
        if act.phase not in HELD or dropped or grip == 0:
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
