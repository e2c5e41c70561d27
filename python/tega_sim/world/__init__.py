"""Simulate hand, arm, table and an object by rigid-body physics (MuJoCo).

::

    from tega_sim.world import FULL_DUTY_NM, World, hand_controller

    world, controller = World("bottle", seed=1), hand_controller()
    for tick in range(1000):
        world.set_torques(FULL_DUTY_NM * controller.step(world.angles_rad, 5))
        world.advance_to((tick + 1) * 0.003)
    world.truth().pad_force_n

Contents and limits: ``docs/evidence/sim.md``. Needs the extra ``sim``.
"""

from __future__ import annotations

from tega.hand.mjcf import FULL_DUTY_NM, TORQUE_LIMITS_NM
from tega_sim.world.body import Shape
from tega_sim.world.objects import OBJECTS, ObjectRecord, ObjectSpec, crossed, read_objects
from tega_sim.world.scene import GRASP_POSES_RAD, hand_controller
from tega_sim.world.world import World

__all__ = [
    "FULL_DUTY_NM",
    "GRASP_POSES_RAD",
    "OBJECTS",
    "TORQUE_LIMITS_NM",
    "ObjectRecord",
    "ObjectSpec",
    "Shape",
    "World",
    "crossed",
    "hand_controller",
    "read_objects",
]
