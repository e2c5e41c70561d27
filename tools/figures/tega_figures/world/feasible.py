"""Outcome of a hold by the level of the grip, for tasks in which information could help; scripted people only.

``python -m tega_figures.world.feasible`` prints a table. A script grips at one level; in half of the holds it
answers each slide a second later by one level more. A task is of use where levels differ and the answer comes in
time.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

from tega.hand.mjcf import FULL_DUTY_NM
from tega_figures.world.lift import LIFT_M
from tega_sim.filling import HOLD_S, Filling
from tega_sim.operator.motor import AWAY_M, SimulatedForearm
from tega_sim.score import SLIP_M_S
from tega_sim.world.objects import OBJECTS, ObjectSpec
from tega_sim.world.poses import hand_controller
from tega_sim.world.world import World

__all__ = ["TASKS", "HoldTask", "Outcome", "hold"]

_ANSWER_S: Final = 1.0
# The hand needs this long to follow an answer; a slide until then calls for no other.
_FOLLOWS_S: Final = 0.5
_TICK_S: Final = 3e-3
# Closing, lifting and holding begin, seconds.
_CLOSE_S, _LIFT_S, _HOLD_S = 1.6, 4.0, 6.0


class HoldTask(NamedTuple):
    """A task.

    ``push`` makes, of a seed, the force from above by the time since the hold began, newtons and seconds;
    ``away_m`` is how far the object is carried while it is held.
    """

    spec: ObjectSpec
    push: Callable[[int], Callable[[float], float]]
    away_m: float = 0.0


class Outcome(NamedTuple):
    """Outcome of one hold.

    Attributes:
        lost: Whether the object slid 30 mm, fell, or was not lifted.
        harmed: Whether it was narrowed by its ``harm_m`` or more.
        first_s: When it first slid at 5 mm/s after the hold began, since then; ``None`` if it didn't.
        lost_s: When it was lost, likewise.
    """

    lost: bool
    harmed: bool
    first_s: float | None
    lost_s: float | None


def _knocks(seed: int) -> Callable[[float], float]:
    times_s = 1.0 + np.cumsum(np.random.default_rng(seed).uniform(1.5, 2.5, 4))
    return lambda t_s: 20.0 if any(at <= t_s < at + 0.03 for at in times_s) else 0.0


def _filling(seed: int) -> Callable[[float], float]:
    filling = Filling(seed)
    return lambda t_s: filling.force_n(t_s, holding=True)


TASKS: Final = {
    "four knocks of 20 N, 30 ms": HoldTask(OBJECTS["container"], _knocks),
    "filled by 1.5 kg": HoldTask(OBJECTS["container"].with_(mass_kg=0.35), _filling),
    "soft and smooth, carried": HoldTask(
        OBJECTS["container"].with_(stiffness_n_m=800.0, friction=0.5), lambda _seed: lambda _t_s: 0.0, AWAY_M
    ),
}
"""The three candidates."""


def hold(task: HoldTask, level: int, seed: int, *, answers: bool) -> Outcome:
    """Grip at a level, 2 to 5, lift, and hold for ten seconds.

    ``seed`` is of the object's place and of the pushes. With ``answers``, each slide in the hold is answered
    a second later by one level more.
    """
    world, controller, push = World(task.spec, seed=seed), hand_controller(), task.push(seed)
    forearm = SimulatedForearm((0.0, 0.1))
    moves = {0.0: ((0.0, 0.0), 1.2), _LIFT_S: ((LIFT_M, 0.0), _HOLD_S - _LIFT_S)}
    moves |= {_HOLD_S + 1: ((LIFT_M, task.away_m), 1.5)} if task.away_m else {}
    first_s = slid_s = None
    free_s, harmed = 0.0, False
    for tick in range(round((_HOLD_S + HOLD_S) / _TICK_S)):
        t_s = tick * _TICK_S
        held_s = t_s - _HOLD_S
        for start_s in [start for start in moves if start <= t_s]:
            forearm.move(moves[start_s][0], t_s, moves.pop(start_s)[1])
        world.set_forearm(forearm.step(t_s))
        world.push(push(held_s) if held_s >= 0 else 0.0)
        if answers and slid_s is not None and held_s >= slid_s + _ANSWER_S:
            level, slid_s, free_s = min(level + 1, 5), None, held_s + _FOLLOWS_S
        wanted = 1 if t_s < _CLOSE_S else level
        world.set_torques(FULL_DUTY_NM * controller.step(world.angles_rad, wanted))
        world.advance_to(t_s + _TICK_S)
        truth = world.truth()
        harmed = harmed or truth.deformation_m >= task.spec.harm_m
        if truth.dropped:
            return Outcome(lost=True, harmed=harmed, first_s=first_s, lost_s=held_s)
        if held_s >= free_s and slid_s is None and truth.slip_m_s >= SLIP_M_S:
            slid_s = held_s
            first_s = slid_s if first_s is None else first_s
    return Outcome(lost=not truth.lift_off, harmed=harmed, first_s=first_s, lost_s=None)


def _row(name: str, level: int, seeds: range) -> str:
    alone, helped = ([hold(TASKS[name], level, seed, answers=on) for seed in seeds] for on in (False, True))
    time_s = [one.lost_s - one.first_s for one in alone if one.lost_s is not None and one.first_s is not None]
    counts = [f"{sum(o.lost for o in some)}, {sum(o.harmed for o in some)}" for some in (alone, helped)]
    return f"| {name} | {level} | {' | '.join(counts)} | {f'{np.median(time_s):.1f}' if time_s else ''} |"


def _main() -> None:
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("--seeds", type=int, default=6, help="holds in each cell")
    n = words.parse_args().seeds
    print(f"| task | level | lost, harmed of {n} | with an answer | from first slide to loss, s, median |")
    print("|---" * 5 + "|")
    for name in TASKS:
        for level in range(2, 6):
            print(_row(name, level, range(n)), flush=True)


if __name__ == "__main__":
    _main()
