"""What stays bounded while a simulated object is held for ten minutes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tega.hand.mjcf import FULL_DUTY_NM
from tega_figures.world.lift import LIFT_M
from tega_sim.world.objects import ObjectSpec
from tega_sim.world.poses import hand_controller
from tega_sim.world.scene import Physics
from tega_sim.world.world import World

__all__ = ["Bounds", "bounds"]


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
