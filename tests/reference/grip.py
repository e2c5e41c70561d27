"""A hand around an object in the simulated world."""

from typing import Any

from tega_sim.seams import WorldTruth
from tega_sim.world import FULL_DUTY_NM, ObjectSpec, World, hand_controller

__all__ = ["TICK_S", "Grip"]

TICK_S = 0.003


class Grip:
    """A world with its hand's loop closed, in the grasp pose."""

    def __init__(self, spec: ObjectSpec | str, **arguments: Any) -> None:
        self.world = World(spec, start_m=(0.0, 0.0), **arguments)
        self.controller = hand_controller()
        self.ticks = 0

    def hold(self, level: int, seconds: float, forearm_m: tuple[float, float] | None = None) -> WorldTruth:
        """Ask for a level for so long, and return what is true then."""
        if forearm_m is not None:
            self.world.set_forearm(forearm_m)
        for _ in range(round(seconds / TICK_S)):
            self.ticks += 1
            self.world.set_torques(FULL_DUTY_NM * self.controller.step(self.world.angles_rad, level))
            self.world.advance_to(self.ticks * TICK_S)
        return self.world.truth()
