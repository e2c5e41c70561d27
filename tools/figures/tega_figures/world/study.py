"""Run time against error of the physics' settings, and what stays bounded in ten minutes."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final, NamedTuple

import numpy as np

from tega.hand.mjcf import FULL_DUTY_NM
from tega.runtime.child_process import isolated_workers
from tega_figures.world.lift import LIFT_M, LiftResult, lift
from tega_sim.world.objects import OBJECTS, ObjectSpec
from tega_sim.world.poses import hand_controller
from tega_sim.world.scene import Physics
from tega_sim.world.shells import wall_rad_s
from tega_sim.world.world import World

__all__ = ["CASES", "REFERENCE", "SETTINGS", "Bounds", "Error", "Stiff", "bounds", "compare", "stiff_walls"]

CASES: Final = (("bottle", 3), ("bottle", 4), ("container", 2), ("container", 3), ("bag", 3), ("bag", 4))
"""Object and level of the lifts compared: for each object one that barely holds and one that does."""

REFERENCE: Final = Physics(timestep_s=2.5e-4, tolerance=1e-12)
"""What errors are counted from."""

SETTINGS: Final[dict[str, Physics]] = {
    f"{name}, {step_s * 1e3:g} ms": Physics(timestep_s=step_s, **extra)
    for name, extra in (
        ("default", {}),
        ("impratio 100", {"impratio": 100.0}),
        ("discrete", {"integrator": "discrete"}),
        ("impratio 10, noslip 3", {"impratio": 10.0, "noslip": 3}),
        ("tolerance 1e-8", {"tolerance": 1e-8}),
        ("tolerance 1e-5", {"tolerance": 1e-5}),
        ("hard onset", {"onset": 0.95, "width_m": 0.001}),
    )
    for step_s in (5e-4, 1e-3, 1.5e-3, 3e-3)
}
"""The settings compared, by name."""

_TOUCHES_S: Final = 2.0


class Error(NamedTuple):
    """How far a setting's lifts are from the reference's: the largest over the cases.

    Attributes:
        slip_m: Of the slip at the end.
        slip_count: Of the number of slips.
        force_share: Of the highest pad force, as a share of it.
        height_m: Of the object's height at the end.
        narrowing_m: Of the largest deformation.
        creep_m_s: Sinking of the held object in the last half second; not an error but what is to be small.
        chatter_n: Mean change of a pad's force from one 3 ms to the next while gripping; likewise.
        same_outcomes: Whether the same lifts held.
        cpu_us: Processor time that the world took for a simulated millisecond, median over the cases, microseconds.
    """

    slip_m: float
    slip_count: int
    force_share: float
    height_m: float
    narrowing_m: float
    creep_m_s: float
    chatter_n: float
    same_outcomes: bool
    cpu_us: float


def compare(settings: dict[str, Physics] | None = None, *, jobs: int = 1) -> dict[str, Error]:
    """Return each setting's error.

    Args:
        settings: By name; None: :data:`SETTINGS`.
        jobs: Lifts at a time; more than one makes ``cpu_us`` less trustworthy.
    """
    chosen = SETTINGS if settings is None else settings
    names = ["", *chosen]
    tasks = [(case, chosen.get(name, REFERENCE)) for name in names for case in CASES]
    lifts = list(_run(tasks, jobs))
    rows = [lifts[i : i + len(CASES)] for i in range(0, len(lifts), len(CASES))]
    return {name: _error(row, rows[0]) for name, row in zip(chosen, rows[1:], strict=True)}


def _run(tasks: list[tuple[tuple[str, int], Physics]], jobs: int) -> Iterable[LiftResult]:
    if jobs == 1:
        return map(_one, tasks)
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    with isolated_workers(), ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        return list(pool.map(_one, tasks))


def _one(task: tuple[tuple[str, int], Physics]) -> LiftResult:
    (name, level), physics = task
    return lift(name, level, physics=physics)


def _error(lifts: list[LiftResult], reference: list[LiftResult]) -> Error:
    pairs = list(zip(lifts, reference, strict=True))
    return Error(
        slip_m=max(abs(a.slip_m - b.slip_m) for a, b in pairs),
        slip_count=max(abs(a.slips - b.slips) for a, b in pairs),
        force_share=max(abs(a.peak_force_n / b.peak_force_n - 1) for a, b in pairs),
        height_m=max(abs(a.height_m - b.height_m) for a, b in pairs),
        narrowing_m=max(abs(a.narrowing_m - b.narrowing_m) for a, b in pairs),
        creep_m_s=max(abs(_creep_m_s(a)) for a, _ in pairs if a.held),
        chatter_n=max(_chatter_n(a) for a, _ in pairs),
        same_outcomes=all(a.held == b.held for a, b in pairs),
        cpu_us=float(np.median([a.cpu_us for a, _ in pairs])),
    )


def _creep_m_s(one: LiftResult) -> float:
    end = one.trace[-1]
    before = next(truth for truth in one.trace if truth.t_s >= end.t_s - 0.5)
    return (end.slip_m - before.slip_m) / (end.t_s - before.t_s)


def _chatter_n(one: LiftResult) -> float:
    forces = np.array([truth.pad_force_n for truth in one.trace if truth.t_s > _TOUCHES_S])
    return float(np.abs(np.diff(forces, axis=0)).mean(axis=0).max())


class Stiff(NamedTuple):
    """A lift of a light object with a stiff wall, with a step and with the reference's.

    Attributes:
        spec: The object.
        physics: How the motion was computed.
        turn_rad: How far the wall's own oscillation turns in a step, radians.
        force_share: Error of the highest pad force, as a share of it.
        slip_m: Error of the slip at the end.
    """

    spec: ObjectSpec
    physics: Physics
    turn_rad: float
    force_share: float
    slip_m: float


def stiff_walls(name: str = "bag", level: int = 4, mass_kg: float = 0.15) -> list[Stiff]:
    """Return what steps do to a light object, from a soft wall to the stiffest: which default they need.

    Args:
        name: The object.
        level: Closure level.
        mass_kg: How light it is made.
    """
    found = []
    for stiffness_n_m in (250.0, 1000.0, 3000.0, 10_000.0):
        spec = OBJECTS[name].with_(mass_kg=mass_kg, stiffness_n_m=stiffness_n_m)
        exact = lift(spec, level, physics=REFERENCE)
        for step_s in (3e-3, 1.5e-3, 7.5e-4):
            physics = Physics(timestep_s=step_s)
            one = lift(spec, level, physics=physics)
            force = abs(one.peak_force_n / exact.peak_force_n - 1)
            turn = wall_rad_s(spec) * step_s
            found.append(Stiff(spec, physics, turn, force, abs(one.slip_m - exact.slip_m)))
    return found


class Bounds(NamedTuple):
    """What a long hold stays within.

    Attributes:
        simulated_s: How long it was.
        penetration_m: Deepest overlap of two shapes.
        kinetic_j: Highest kinetic energy once the hand is up.
        slip_m: How far the object sank in all.
        slip_m_s: That over the time.
        finite: Whether every number stayed finite.
        held: Whether it was still held at the end.
    """

    simulated_s: float
    penetration_m: float
    kinetic_j: float
    slip_m: float
    slip_m_s: float
    finite: bool
    held: bool


def bounds(
    spec: ObjectSpec | str = "bottle",
    level: int = 4,
    *,
    seconds: float = 600.0,
    physics: Physics | None = None,
) -> Bounds:
    """Grasp, lift, and hold an object for a long time while the grip goes between two levels twice a minute.

    Args:
        spec: The object, or its name.
        level: Closure level; every 30 s for 10 s it is one more.
        seconds: How long to hold.
        physics: How the motion is computed.
    """
    world, controller = World(spec, physics=physics, start_m=(0.0, 0.0)), hand_controller()
    mujoco, data = world.mujoco, world.data
    penetration = kinetic = up_slip = 0.0
    tick, up_s = 0, 5.0
    finite = True
    while tick * 3e-3 < up_s + seconds:
        t_s = tick * 3e-3
        world.set_forearm((LIFT_M if t_s >= 3.5 else 0.0, 0.0))
        wanted = 1 if t_s < 1.6 else level + (t_s > up_s and (t_s - up_s) % 30 > 20)
        world.set_torques(FULL_DUTY_NM * controller.step(world.angles_rad, wanted))
        tick += 1
        world.advance_to(tick * 3e-3)
        penetration = max(penetration, -float(data.contact.dist.min(initial=0.0)))
        if t_s <= up_s:
            up_slip = world.truth().slip_m
            continue
        if tick % 10 == 0:
            mujoco.mj_energyVel(world.model, data)
            kinetic = max(kinetic, float(data.energy[1]))
            finite = finite and bool(np.isfinite(data.qpos).all() and np.isfinite(data.qvel).all())
    truth = world.truth()
    slip = truth.slip_m - up_slip
    return Bounds(
        seconds, penetration, kinetic, slip, slip / seconds, finite, truth.lift_off and not truth.dropped
    )
