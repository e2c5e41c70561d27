"""Draw the pictures of README and the teaching pages: ``make pictures``.

Set-up, hardware and objects are the counterparts of the paper's Figures 5, 2 and 4, drawn by us; the sizes of the
objects are those of the simulated world. The animation is one simulated lift.
"""

from __future__ import annotations

import sys
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Ellipse, FancyArrowPatch, FancyBboxPatch, Polygon, Rectangle
from PIL import Image

from tega.ui.view.figures import FINGER_COLOURS
from tega.ui.view.state import ViewState
from tega_figures.world.solids import add_solids
from tega_sim.demo import run_demo
from tega_sim.trials import plan_trials
from tega_sim.world import OBJECTS, World

HERE = Path(__file__).resolve().parent
INK, SOFT, PALE, ROBOT, PERSON = "#2b3440", "#4b5866", "#eef1f5", "#d9e8f5", "#fbeadb"
STEADY = {"svg.hashsalt": "tega", "svg.fonttype": "none", "font.family": "sans-serif"}
FRAME_S, FAST_FORWARD = 0.2, 2


def _canvas(width: float, height: float, title: str) -> tuple[Figure, Any]:
    figure = Figure(figsize=(width, height))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_xlim(0, 10 * width)
    axes.set_ylim(0, 10 * height)
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.text(
        5 * width, 10 * height - 3, title, ha="center", va="center", weight="bold", fontsize=12, color=INK
    )
    return figure, axes


def _save_svg(figure: Figure, name: str) -> None:
    from matplotlib import rc_context

    with rc_context(STEADY):
        figure.savefig(HERE / name, metadata={"Date": None})


def _box(  # noqa: PLR0917  # where, how large, what and how
    axes: Any, x: float, y: float, width: float, height: float, text: str, colour: str
) -> None:
    axes.add_patch(
        FancyBboxPatch(
            (x, y), width, height, boxstyle="round,pad=0,rounding_size=1.2", fc=colour, ec=INK, lw=1
        )
    )
    axes.text(x + width / 2, y + height / 2, text, ha="center", va="center", fontsize=8.5, color=INK)


def _arrow(
    axes: Any, begin: tuple[float, float], end: tuple[float, float], text: str, above: float = 1.4
) -> None:
    axes.add_patch(FancyArrowPatch(begin, end, arrowstyle="-|>", mutation_scale=11, color=INK, lw=1.2))
    middle = np.add(begin, end) / 2
    # On white, so that an arrow never goes through its words.
    ground = {"fc": "white", "ec": "none", "pad": 1.0}
    axes.text(
        middle[0], middle[1] + above, text, ha="center", va="center", fontsize=7.5, color=SOFT, bbox=ground
    )


def hardware() -> None:
    """Draw which device is connected to what (the paper's Figure 2)."""
    figure, axes = _canvas(9, 4.4, "Hardware and its connections")
    for y, text in (
        (31, "EMG: three electrode pairs\nand a reference"),
        (21, "tracker of the forearm\n(headset, controller)"),
        (11, "dead-man switch\n(pedal, SpaceMouse)"),
        (1, "vest: 40 motors,\na column a finger"),
    ):
        _box(axes, 2, y, 22, 7, text, PERSON)
    _box(
        axes, 36, 8, 18, 24, "computer\n\nLinux, Python 3.11\n\ntouch: 60 Hz\nvest: 30 Hz\nhand: 333 Hz", PALE
    )
    for y, text in (
        (31, "arm: Franka Panda, FR3"),
        (18, "hand: Allegro Hand v4"),
        (5, "fingertips: four DIGIT\ncameras in soft gel"),
    ):
        _box(axes, 66, y, 22, 7, text, ROBOT)
    _arrow(axes, (24, 34.5), (36, 29), "USB, radio")
    _arrow(axes, (24, 24.5), (36, 23), "network")
    _arrow(axes, (24, 14.5), (36, 17), "USB")
    _arrow(axes, (36, 11), (24, 4.5), "Bluetooth", above=-2.4)
    _arrow(axes, (54, 29), (66, 34.5), "Ethernet")
    _arrow(axes, (54, 20), (66, 21.5), "CAN, 1 Mbit/s")
    _arrow(axes, (66, 8.5), (54, 12), "USB", above=-2.0)
    axes.text(13, 39.8, "on the person", ha="center", fontsize=9, color="#a05a1c")
    axes.text(77, 39.8, "on the robot", ha="center", fontsize=9, color="#2f6690")
    axes.text(
        77,
        14.5,
        "a switch in the 12 V line,\nan emergency stop within reach",
        ha="center",
        fontsize=7.5,
        color="#b00020",
    )
    _save_svg(figure, "setup-hardware.svg")


def objects() -> None:
    """Draw the three objects with their sizes (the paper's Figure 4)."""
    figure, axes = _canvas(9, 4.2, "The three objects, to scale")
    for n, (spec, text) in enumerate(
        zip(OBJECTS.values(), ("rigid and heavy", "medium stiffness", "soft, deforms"), strict=True)
    ):
        x, floor = 16 + 28 * n, 9.0
        scale = 90.0  # drawing units a metre
        width, height = scale * spec.diameter_m, scale * spec.height_m
        colour = spec.rgba[:3]
        if spec.name == "bottle":
            body = [(-1, 0), (1, 0), (1, 0.72), (0.35, 0.9), (0.35, 1), (-0.35, 1), (-0.35, 0.9), (-1, 0.72)]
        elif spec.name == "container":
            body = [
                (-0.95, 0),
                (0.95, 0),
                (1, 0.88),
                (1.05, 0.88),
                (1.05, 1),
                (-1.05, 1),
                (-1.05, 0.88),
                (-1, 0.88),
            ]
        else:
            body = [
                (-0.8, 0),
                (0.8, 0),
                (1, 0.2),
                (0.9, 0.5),
                (1, 0.75),
                (0.3, 0.86),
                (0.5, 1),
                (-0.5, 1),
                (-0.3, 0.86),
            ]
            body += [(-1, 0.75), (-0.9, 0.5), (-1, 0.2)]
        axes.add_patch(
            Polygon([(x + a * width / 2, floor + b * height) for a, b in body], fc=colour, ec=INK, lw=1.2)
        )
        if spec.name == "bag":
            axes.plot([x - 1.4, x + 1.4], [floor + 0.86 * height] * 2, color="#b00020", lw=2)
        axes.text(x, 5.6, f"{n + 1}  {spec.name}: {text}", ha="center", fontsize=9, weight="bold", color=INK)
        axes.text(
            x,
            2.2,
            f"{1000 * spec.diameter_m:.0f} mm wide, {1000 * spec.height_m:.0f} mm high, {spec.mass_kg:.2f} kg\n"
            f"{spec.stiffness_n_m:.0f} N/m, friction {spec.friction}",
            ha="center",
            va="center",
            fontsize=8,
            color=SOFT,
        )
    axes.plot([2, 88], [9, 9], color=INK, lw=1.5)
    axes.plot([4, 4], [9, 18], color=INK, lw=1)
    axes.text(4.8, 13.5, "10 cm", fontsize=8, va="center", color=INK)
    _save_svg(figure, "setup-objects.svg")


def bench() -> None:
    """Draw operator, robot and table (the paper's Figure 5)."""
    figure, axes = _canvas(
        9, 4.6, "The set-up: the operator leads arm and hand, and feels the fingertips on the vest"
    )
    # The operator, from the front: column 1 is at their own left, which is at the right as drawn.
    axes.add_patch(Circle((17, 34), 3.6, fc=PERSON, ec=INK))
    axes.add_patch(Polygon([(9, 29), (25, 29), (23, 9), (11, 9)], fc="#dfe5ec", ec=INK))
    for column, colour in enumerate(reversed(FINGER_COLOURS.values())):
        for row in range(5):
            axes.add_patch(Circle((12.6 + 2.9 * column, 26 - 3.4 * row), 0.95, fc=colour, ec=INK, lw=0.5))
    axes.plot([24.5, 30, 38], [27, 19, 23], color="#e0b48c", lw=11, solid_capstyle="round", zorder=0)
    for x, y in ((32, 20), (34, 21), (36, 22)):
        axes.add_patch(Rectangle((x - 0.5, y - 0.8), 1, 1.6, fc="#ffd54d", ec=INK, lw=0.7))
    axes.add_patch(Rectangle((29, 16.6), 2, 2, fc="#7a5ea8", ec=INK, lw=0.7))
    axes.annotate(
        "three EMG channels", (34, 21.5), (31, 29), fontsize=8, arrowprops={"arrowstyle": "-", "color": INK}
    )
    axes.annotate("tracker", (30, 17), (29, 11), fontsize=8, arrowprops={"arrowstyle": "-", "color": INK})
    axes.text(
        17,
        5.6,
        "vest, seen from the front:\na column a finger, CCI here, EDA on the back",
        ha="center",
        fontsize=7.5,
        color=INK,
    )
    # The robot.
    axes.plot([46, 89], [8, 8], color=INK, lw=3)
    axes.text(67, 4.6, "table, with the two places of the task", ha="center", fontsize=8, color=INK)
    axes.plot(
        [84, 84, 77, 68, 63],
        [9.4, 20, 33, 34, 27],
        color="#c3cad3",
        lw=13,
        solid_capstyle="round",
        solid_joinstyle="round",
        zorder=1,
    )
    for x, y in ((84, 20), (77, 33), (68, 34)):
        axes.add_patch(Circle((x, y), 1.6, fc="#8d99a6", ec=INK, lw=0.7, zorder=2))
    axes.add_patch(Rectangle((59.5, 23.5), 7, 4.5, fc="#39424e", ec=INK, zorder=3))
    for x, bend, colour in zip(
        (60, 62, 64, 66), (-1.2, -0.4, 0.4, 1.2), FINGER_COLOURS.values(), strict=True
    ):
        axes.plot([x, x + bend, x + 0.2 * bend], [23.5, 20.5, 17.5], color="#39424e", lw=4, zorder=3)
        axes.add_patch(Ellipse((x + 0.2 * bend, 17.2), 1.7, 2.2, fc=colour, ec=INK, lw=0.7, zorder=4))
    axes.add_patch(Rectangle((61, 8.4), 4.6, 9.6, fc=OBJECTS["bottle"].rgba[:3], ec=INK, lw=0.8, zorder=2))
    axes.add_patch(Ellipse((52, 8.6), 6, 1.2, fc="none", ec="#b00020", lw=1.2))
    axes.add_patch(Ellipse((63.3, 8.6), 7, 1.2, fc="none", ec="#b00020", lw=1.2))
    axes.text(86, 36, "Franka arm,\n7 joints", ha="center", fontsize=8, color=INK)
    axes.annotate(
        "Allegro Hand", (60, 26), (47.5, 30), fontsize=8, arrowprops={"arrowstyle": "-", "color": INK}
    )
    axes.annotate(
        "a DIGIT at each\nfingertip",
        (60, 17),
        (47, 20),
        fontsize=8,
        arrowprops={"arrowstyle": "-", "color": INK},
    )
    axes.annotate(
        "object",
        (65.6, 12),
        (71, 12.6),
        fontsize=8,
        va="center",
        arrowprops={"arrowstyle": "-", "color": INK},
    )
    axes.text(
        45,
        1.2,
        "EMG sets how far the hand closes; the tracker leads the arm; a fingertip is felt in the column of its colour",
        ha="center",
        fontsize=8.5,
        weight="bold",
        color=INK,
    )
    _save_svg(figure, "setup-bench.svg")


class Snapshot(NamedTuple):
    """What one picture of the animation shows."""

    t_s: float
    poses: Any
    motors: Any
    level: int
    height_m: float


def animation(name: str = "bottle") -> None:
    """Record one simulated lift and draw it, twice as fast as it goes."""
    moments: list[Snapshot] = []

    def see(state: ViewState) -> None:
        t_s = state.loop.t_ns / 1e9
        if state.poses is not None and (not moments or t_s >= moments[-1].t_s + FRAME_S - 1e-6):
            motors = np.zeros(40) if state.loop.vest is None else state.loop.vest.x40()
            level = 1 if state.loop.intent is None else state.loop.intent.level
            moments.append(Snapshot(t_s, np.array(state.poses), np.array(motors), int(level), 0.0))

    plans = plan_trials([name], ["haptic"], [1])
    _, (course,) = run_demo(plans, real_time=False, observer=see)
    times, heights = (course.array("truth", key) for key in ("t_s", "object_height_m"))
    shapes = World(name, start_m=(0.0, 0.0)).shapes()
    pictures = [
        _frame(m._replace(height_m=float(np.interp(m.t_s, times, heights))), shapes, name) for m in moments
    ]
    pictures[0].save(
        HERE / "demo-lift.webp",
        save_all=True,
        append_images=pictures[1:],
        duration=int(1000 * FRAME_S / FAST_FORWARD),
        loop=0,
        quality=60,
        method=4,
    )


def _frame(moment: Snapshot, shapes: Any, name: str) -> Image.Image:
    figure = Figure(figsize=(7.2, 3.6), dpi=100)
    # Square, so that nothing of the table is cut off at a side.
    scene = figure.add_axes((0.0, -0.04, 0.485, 0.97), projection="3d", computed_zorder=False)
    add_solids(scene, shapes, moment.poses, thing=name)
    scene.set_xlim(-0.27, 0.23)
    scene.set_ylim(-0.2, 0.3)
    scene.set_zlim(0.05, 0.55)
    scene.set_box_aspect((1, 1, 1), zoom=1.5)
    scene.view_init(elev=20, azim=-12)
    scene.set_axis_off()
    axes = figure.add_axes((0.505, 0, 0.49, 1))
    axes.set_xlim(0, 100)
    axes.set_ylim(0, 100)
    axes.set_axis_off()
    axes.text(50, 95, "vest from outside; left, right: the wearer's", ha="center", fontsize=8, color=SOFT)
    for left, title, first in ((3, "front (CCI): how sharp", 0), (53, "back (EDA): how wide", 20)):
        axes.text(left + 22, 88, title, ha="center", fontsize=9, color=INK)
        # Who faces the wearer sees the first column, which is at the wearer's left, at the right.
        places = [left + 6 + 10.6 * (column if first else 3 - column) for column in range(4)]
        ends = ("left", "right") if first else ("right", "left")
        axes.text(left + 1, 23.5, ends[0], fontsize=7, color=SOFT)
        axes.text(left + 43, 23.5, ends[1], ha="right", fontsize=7, color=SOFT)
        for x, finger in zip(places, FINGER_COLOURS, strict=True):
            axes.text(x, 83, finger, ha="center", fontsize=7, color=INK)
        for motor in range(20):
            row, column = divmod(motor, 4)
            colour = list(FINGER_COLOURS.values())[column]
            share = float(moment.motors[first + motor]) / 100
            centre = (places[column], 76 - 11 * row)
            axes.add_patch(Circle(centre, 4.2, fc="white", ec="#b9c2cc", lw=1))
            axes.add_patch(Circle(centre, 4.2, fc=colour, alpha=share, lw=0))
    axes.text(3, 15, "level", fontsize=9, color=INK)
    for level in range(1, 6):
        filled = level <= moment.level
        axes.add_patch(Rectangle((15 + 6 * level, 13), 5, 6, fc="#c8202f" if filled else "#eceff2", lw=0))
    axes.text(
        3, 4, f"{name} {100 * max(moment.height_m, 0):.0f} cm up, {moment.t_s:.1f} s", fontsize=9, color=INK
    )
    figure.text(0.02, 0.94, "a simulated lift, twice as fast", fontsize=9, color=SOFT)
    buffer = BytesIO()
    figure.savefig(buffer, format="png")
    return Image.open(buffer).convert("RGB")


def main() -> None:
    """Draw what is named on the command line, or all."""
    for draw in (hardware, objects, bench, animation):
        if len(sys.argv) == 1 or draw.__name__ in sys.argv[1:]:
            draw()


if __name__ == "__main__":
    main()
