"""Measure what MuJoCo alone takes for a simulated lift, as the yardstick of the whole simulated bench.

The scenes beside this file are those of version 0.2.0 and stay as they are, so that a later bench can be held to the
same yardstick however its own scene and step change. A lift notes what its world is told at each step; afterwards
MuJoCo steps the frozen scene with the same torques, forces and number of steps, and nothing else.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.resources import files
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega_sim.world import World

__all__ = ["NotedSteps", "alone_s", "noted_steps"]


class NotedSteps(NamedTuple):
    """What the world of one lift was told, and how often it stepped.

    Attributes:
        object: The object's name.
        began: State of the world at the lift's beginning: positions, velocities and activations, float64.
        steps: Controls, forces applied to the joints, and seconds until the next, one by one.
    """

    object: str
    began: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
    steps: list[tuple[NDArray[np.float64], NDArray[np.float64], float]]


@contextmanager
def noted_steps() -> Iterator[list[NotedSteps]]:
    """Note what every world is told in the block."""
    from tega_sim.world import World

    noted: list[NotedSteps] = []
    of: dict[World, NotedSteps] = {}
    advance_to = World.advance_to

    def advance(world: World, t_s: float) -> None:
        data = world.data
        if world not in of:
            began = (np.array(data.qpos), np.array(data.qvel), np.array(data.act))
            noted.append(NotedSteps(world.spec.name, began, []))
            of[world] = noted[-1]
        before_s, told = world.t_s, np.array(data.ctrl)
        advance_to(world, t_s)
        if world.t_s > before_s:
            # The hand's torques change between calls, the arm's speed within them too, by next to nothing.
            told[:7] = data.ctrl[:7]
            of[world].steps.append((told, np.array(data.qfrc_applied), world.t_s - before_s))

    World.advance_to = advance  # type: ignore[method-assign, assignment]
    try:
        yield noted
    finally:
        World.advance_to = advance_to  # type: ignore[method-assign]


def alone_s(lift: NotedSteps) -> float:
    """Step the frozen scene of a lift's object as the lift did, and return the processor time it took, seconds.

    Raises:
        FileNotFoundError: No scene of this object was kept.
        RuntimeError: The frozen scene has other joints than what was noted.
    """
    from tega_sim.world.scene import import_mujoco

    mujoco: Any = import_mujoco()
    text = files(__package__).joinpath("frozen", f"{lift.object}.xml").read_text(encoding="utf-8")
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    shapes = [
        (len(now), len(then)) for now, then in zip((data.qpos, data.qvel, data.act), lift.began, strict=True)
    ]
    if any(now != then for now, then in shapes):
        raise RuntimeError(f"the frozen scene of {lift.object!r} has other joints than the lift: {shapes}")
    data.qpos[:], data.qvel[:], data.act[:] = lift.began
    mujoco.mj_forward(model, data)
    steps = [(told, forces, round(s / model.opt.timestep)) for told, forces, s in lift.steps]
    ctrl, applied, step = data.ctrl, data.qfrc_applied, mujoco.mj_step
    began_s = time.thread_time()
    for told, forces, n in steps:
        ctrl[:], applied[:] = told, forces
        step(model, data, n)
    return time.thread_time() - began_s
