"""Pictures of the simulated world for the documentation."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tega.errors import MissingExtraError
from tega.hand.mjcf import FULL_DUTY_NM
from tega.ui.view.figures import FINGER_COLOURS
from tega_figures.world.lift import LIFT_M, LiftResult
from tega_figures.world.solids import add_solids
from tega_sim.world.objects import OBJECTS
from tega_sim.world.poses import hand_controller
from tega_sim.world.scene import Physics
from tega_sim.world.world import World

if TYPE_CHECKING:
    from tega_figures.world.study import Error

__all__ = ["draw_all"]

_COLOURS: Final = {"bottle": "#2b6ca3", "container": "#6b7a3a", "bag": "#b07a2a"}
_LEVELS: Final = {"bottle": 4, "container": 3, "bag": 3}
_N_PER_M: Final = 80.0


def draw_all(folder: Path, lifts: dict[str, list[LiftResult]], errors: dict[str, Error]) -> list[Path]:
    """Draw what there is, and the scene.

    Args:
        folder: Where to; made where it is not there.
        lifts: By object, at levels 2 to 5; may be empty.
        errors: By setting; may be empty.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtraError("pictures need matplotlib", "pip install 'tega[pictures]'") from error
    folder.mkdir(parents=True, exist_ok=True)
    done = [_save(_scene(Figure(figsize=(13, 4.8))), folder / "world-scene.png")]
    if lifts:
        done.append(_save(_levels(Figure(figsize=(11, 3.4)), lifts), folder / "world-levels.png"))
        done.append(_save(_traces(Figure(figsize=(11, 6)), lifts), folder / "world-lifts.png"))
    if errors:
        done.append(_save(_settings(Figure(figsize=(9, 4)), errors), folder / "world-settings.png"))
    return done


def _save(figure: Any, path: Path) -> Path:
    figure.savefig(path, dpi=110, bbox_inches="tight")
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


def _levels(figure: Any, lifts: dict[str, list[LiftResult]]) -> Any:
    force, slip, narrow = figure.subplots(1, 3)
    for name, rows in lifts.items():
        levels, colour = np.arange(2, 6), _COLOURS[name]
        pads = [sum(_gripped(one).pad_force_n) for one in rows]
        force.plot(levels, pads, "o-", color=colour, label=name)
        held = [one.held for one in rows]
        slip.plot(levels[held], [1e3 * one.slip_m for one in rows if one.held], "o-", color=colour)
        slip.plot(levels[np.logical_not(held)], [0] * held.count(False), "x", color=colour, ms=9)
        narrow.plot(
            levels, [100 * one.narrowing_m / OBJECTS[name].diameter_m for one in rows], "o-", color=colour
        )
        narrow.axhline(100 * OBJECTS[name].harm_m / OBJECTS[name].diameter_m, color=colour, lw=0.8, ls=":")
    titles = (
        "Force on the four pads, N",
        "Slip after lift-off, mm (x: not lifted)",
        "Narrowing, % (dotted: harm)",
    )
    for axes, title in zip((force, slip, narrow), titles, strict=True):
        axes.set_title(title, fontsize=10)
        axes.set_xlabel("closure level")
        axes.set_xticks(range(2, 6))
        axes.grid(alpha=0.3)
    force.legend(frameon=False)
    figure.tight_layout()
    return figure


def _gripped(one: LiftResult) -> Any:
    return max((truth for truth in one.trace if truth.t_s <= 4.0), key=lambda truth: truth.t_s)


def _traces(figure: Any, lifts: dict[str, list[LiftResult]]) -> Any:
    grid = figure.subplots(2, 3, sharex=True)
    for column, (name, rows) in enumerate(lifts.items()):
        trace = rows[_LEVELS[name] - 2].trace
        times = [truth.t_s for truth in trace]
        upper, lower = grid[:, column]
        for finger, (label, colour) in enumerate(FINGER_COLOURS.items()):
            upper.plot(times, [truth.pad_force_n[finger] for truth in trace], color=colour, lw=1, label=label)
        upper.set_title(f"{name}, level {_LEVELS[name]}: pad forces, N", fontsize=10)
        lower.plot(times, [100 * truth.object_height_m for truth in trace], color="k", label="height, cm")
        lower.plot(times, [1e3 * truth.slip_m for truth in trace], color="#b2182b", label="slip, mm")
        lower.plot(
            times, [1e3 * truth.deformation_m for truth in trace], color="#b07a2a", label="narrowing, mm"
        )
        lower.set_xlabel("time, s")
        for axes in (upper, lower):
            axes.grid(alpha=0.3)
    grid[0, 0].legend(frameon=False, fontsize=8)
    grid[1, 0].legend(frameon=False, fontsize=8)
    figure.tight_layout()
    return figure


def _settings(figure: Any, errors: dict[str, Error]) -> Any:
    chosen = Physics()
    panels = figure.subplots(1, 2)
    marks = {0.5: "s", 1.0: "D", 1.5: "o", 3.0: "^"}
    kinds = dict.fromkeys(name.rsplit(", ", 1)[0] for name in errors)
    colours = dict(
        zip(
            kinds, ("#2166ac", "#b2182b", "#4d9221", "#7b3294", "#35978f", "#999999", "#e08214"), strict=False
        )
    )
    for name, error in errors.items():
        kind, step = name.rsplit(", ", 1)
        step_ms = float(step.split()[0])
        default = step_ms == 1e3 * chosen.timestep_s and kind == "default"
        for axes, value in zip(panels, (1e3 * error.slip_m, 100 * error.force_share), strict=True):
            axes.plot(
                error.cpu_us,
                value,
                marks[step_ms],
                color=colours[kind],
                ms=7,
                label=kind if step_ms == 3 else "",
            )
            if default:
                axes.plot(error.cpu_us, value, "o", ms=15, mfc="none", color="k", label="chosen")
    for axes, title in zip(panels, ("error of slip, mm", "error of the highest force, %"), strict=True):
        axes.set_xlabel("processor time of a simulated millisecond, µs")
        axes.set_title(title, fontsize=10)
        axes.grid(alpha=0.3)
        axes.set_ylim(bottom=0)
    panels[1].legend(frameon=False, fontsize=8)
    panels[0].set_xlim(left=0)
    panels[1].set_xlim(left=0)
    figure.suptitle("steps of 0.5 (square), 1 (diamond), 1.5 (circle), 3 ms (triangle)", fontsize=9)
    figure.tight_layout()
    return figure
