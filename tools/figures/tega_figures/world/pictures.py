"""Draw the simulated world: ``python -m tega_figures.world.pictures docs/images``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, Final

import numpy as np

from tega.hand.mjcf import FULL_DUTY_NM
from tega.runtime.lifecycle import require
from tega_figures.world.lift import LIFT_M
from tega_figures.world.solids import add_solids
from tega_sim.world.objects import OBJECTS
from tega_sim.world.scene import hand_controller
from tega_sim.world.world import World

__all__ = ["draw_scene"]

_LEVELS: Final = {"bottle": 4, "container": 3, "bag": 3}
_N_PER_M: Final = 80.0


def draw_scene(folder: Path) -> Path:
    """Draw the three objects held, with the forces on them, into a folder, made where it is missing."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "world-scene.png"
    figures = require("matplotlib.figure", driver="the picture", extra="pictures")
    _scene(figures.Figure(figsize=(13, 4.8))).savefig(path, dpi=110, bbox_inches="tight")
    return path


def _scene(figure: Any) -> Any:
    for column, name in enumerate(OBJECTS, start=1):
        world, controller = World(name, start_m=(0.0, 0.0)), hand_controller()
        for tick in range(1900):
            world.set_forearm((LIFT_M if tick > 1300 else 0.0, 0.0))
            level = 1 if tick < 530 else _LEVELS[name]
            world.set_torques(FULL_DUTY_NM * controller.step(world.angles_rad, level))
            world.advance_to((tick + 1) * 3e-3)
        axes = figure.add_subplot(1, 3, column, projection="3d", computed_zorder=False)
        add_solids(axes, world.shapes(), world.poses())
        for x, y, z, *force in world.contact_points():
            along = np.array(force) / _N_PER_M
            axes.plot(
                *([a, a - b] for a, b in zip((x, y, z), along, strict=True)), color="#d40000", lw=2, zorder=9
            )
        truth = world.truth()
        axes.set_title(
            f"{name}, level {_LEVELS[name]}: {100 * truth.object_height_m:.0f} cm up, "
            f"pads {sum(truth.pad_force_n):.1f} N",
            fontsize=10,
        )
        axes.set_xlim(-0.27, 0.23)
        axes.set_ylim(-0.2, 0.3)
        axes.set_zlim(0.05, 0.55)
        axes.set_box_aspect((1, 1, 1), zoom=1.5)
        axes.view_init(elev=20, azim=-12)
        axes.set_axis_off()
    return figure


if __name__ == "__main__":
    draw_scene(Path(sys.argv[1]))
