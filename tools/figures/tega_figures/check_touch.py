"""What the simulated touch is worth, as numbers and pictures: ``python -m tega_figures.check_touch``.

Prints the tables of ``docs/evidence/sim-touch.md`` and writes its two pictures into ``docs/images`` or the folder told.
Recorded presses are looked for in the folder that ``TEGA_DATA`` names; without them the tables that need them are left
out.
Needs the extras ``lab`` and ``view``.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import click
import numpy as np
from numpy.typing import NDArray

from tega.runtime.lifecycle import require
from tega.runtime.opencv import read_image
from tega.tactile import read_contact
from tega_figures.audit import Mark, read_marks
from tega_figures.broad import disc_table, grasp_table
from tega_figures.closeness import TOLERANCES, Match, difference, match_press
from tega_sim.gel import LENGTH_MM, STIFFNESS_N_MM3, Gel, ball
from tega_sim.seams import Indenter

__all__ = [
    "GOLDEN",
    "SHAPES",
    "PressReading",
    "RecordedPresses",
    "ball_press",
    "like_presses",
    "readings",
    "shape",
]

# Depth in millimetres and force in newtons of a published test: a 15 mm ball on a GelSight Mini's 4 mm gel (feats).
GOLDEN = ((0.5, 1.650), (1.0, 5.964), (1.5, 13.526), (2.0, 23.253))
GOLDEN_RADIUS_MM = 7.5
FORCES_N = (0.1, 0.2, 0.35, 0.6, 1.0, 1.7, 3.0, 5.0, 8.0)
# Name: kind, size, turn about the picture's x axis in degrees. An edge points at the gel, faces lie flat on it.
SHAPES: dict[str, tuple[str, tuple[float, float, float], float]] = {
    "ball 4.4 mm": ("sphere", (4.4, 0.0, 0.0), 0.0),
    "ball 12 mm": ("sphere", (12.0, 0.0, 0.0), 0.0),
    "cylinder 3 mm": ("cylinder", (3.0, 5.0, 0.0), 90.0),
    "bottle wall 33 mm": ("cylinder", (33.0, 100.0, 0.0), 90.0),
    "edge": ("box", (4.0, 4.0, 4.0), 45.0),
    "flat 5 x 5 mm": ("box", (2.5, 2.5, 2.5), 0.0),
    "flat face": ("box", (30.0, 30.0, 30.0), 0.0),
}


class RecordedPresses(NamedTuple):
    """Recorded ball presses."""

    still: NDArray[np.uint8]
    frames: list[NDArray[np.uint8]]
    marks: list[Mark]


class PressReading(NamedTuple):
    """One simulated press: what is true and what ``live`` reads."""

    force_n: float
    depth_mm: float
    area_px: int
    dent_px: int
    eda: int
    eda_contact: int
    cci: float
    centre_off_px: float


def ball_press(radius_mm: float, contact_mm: float) -> tuple[float, float]:
    """Return depth in millimetres and force in newtons of a ball that touches over a disc: the model's closed form.

    A paraboloid z = r²/2R on a flat skin on springs: inside the contact the skin lies on it, outside it is a K₀(r/l)
    that joins it without a kink, so that d = a²/2R + (a l/R) K₀(a/l)/K₁(a/l). The springs carry
    F = k π [a² (d + 2 l²/R) - a⁴/4R].

    Args:
        radius_mm: R, the ball's.
        contact_mm: a, radius of the touching disc.
    """
    special = require("scipy.special", driver="touch check", extra="lab")
    a, r, length = contact_mm, radius_mm, LENGTH_MM
    depth = a * a / (2 * r) + a * length / r * special.k0e(a / length) / special.k1e(a / length)
    force = STIFFNESS_N_MM3 * np.pi * (a * a * (depth + 2 * length**2 / r) - a**4 / (4 * r))
    return float(depth), float(force)


def shape(name: str, force_n: float, *, centre_xy: tuple[float, float] = (119.5, 159.5)) -> Indenter:
    """Return one of :data:`SHAPES`, pressing."""
    kind, size_mm, turn_deg = SHAPES[name]
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    pose = ball(force_n=force_n, centre_xy=centre_xy).pose_mm.copy()
    pose[:, :3] = [[1, 0, 0], [0, c, -s], [0, s, c]]
    if kind == "cylinder":
        pose[:, :3] = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    return Indenter(kind, size_mm, pose, force_n)  # type: ignore[arg-type]


def readings(name: str, gel: Gel) -> list[PressReading]:
    """Press one of :data:`SHAPES` with rising force and read each picture."""
    still = gel.still()
    found = []
    for index, force_n in enumerate(FORCES_N):
        image = gel.frame([shape(name, force_n)], index)
        truth, height = gel.truth, gel.displacement_mm()
        dent, touch = read_contact(image, still), read_contact(image, still, outline="contact")
        off = float(np.hypot(*np.subtract(dent.centroid_xy, truth.centre_xy)))
        dent_px = 16 * int((height > 0.2 * height.max()).sum())
        found.append(
            PressReading(force_n, truth.depth_mm, truth.area_px, dent_px, dent.eda, touch.eda, dent.cci, off)
        )
    return found


def load_presses(folder: Path) -> RecordedPresses:
    """Read the marked presses of ``digit_ball_D20641``."""
    marks = read_marks(folder / "annotate.csv")
    frames = [read_image(folder / name, driver="touch check") for name in marks]
    return RecordedPresses(
        read_image(folder / "background.png", driver="touch check"), frames, list(marks.values())
    )


def like_presses(presses: RecordedPresses, gel: Gel) -> Iterator[tuple[float, float, float]]:
    """Press where each mark is, with the force at which the mean difference is the recorded one.

    Yields:
        Simulated area, ``live``, and simulated touching area, both over the marked circle's; and the force.
    """
    for index, (frame, mark) in enumerate(zip(presses.frames, presses.marks, strict=True)):
        wanted = np.linalg.norm(difference(frame, presses.still), axis=2).mean()
        untouched, low, high = gel.frame([], index + 1_000), 0.1, 30.0
        for _ in range(9):
            force_n = float(np.sqrt(low * high))
            made = gel.frame([ball(force_n=force_n, centre_xy=mark.centre_xy, on=gel)], index)
            deeper = np.linalg.norm(difference(made, untouched), axis=2).mean() < wanted
            low, high = (force_n, high) if deeper else (low, force_n)
        inside = int((mark.distance(frame.shape) <= 1).sum())
        yield read_contact(made, untouched).eda / inside, gel.truth.area_px / inside, force_n


def _golden_table() -> list[str]:
    gel = Gel(1, shape="flat")
    lines = ["| depth mm | measured N | simulated N | |", "|---|---|---|---|"]
    for depth_mm, measured_n in GOLDEN:
        low, high = 0.05, 60.0
        for _ in range(30):
            force_n = (low * high) ** 0.5
            deep = gel.press([ball(force_n=force_n, radius_mm=GOLDEN_RADIUS_MM)]).depth_mm > depth_mm
            low, high = (low, force_n) if deep else (force_n, high)
        lines.append(f"| {depth_mm} | {measured_n:.2f} | {force_n:.2f} | {force_n / measured_n - 1:+.0%} |")
    return lines


def _radius_table() -> list[str]:
    gel = Gel(1, shape="flat")
    lines = [
        "| ball mm | force N | depth mm | closed form | touching radius mm | closed form | 1.2 √(R d) |",
        "|---|---|---|---|---|---|---|",
    ]
    for radius_mm, contact_mm in ((4.4, 1.0), (4.4, 2.0), (4.4, 2.8), (12.0, 2.0), (12.0, 3.5), (33.0, 4.0)):
        depth_mm, force_n = ball_press(radius_mm, contact_mm)
        truth = gel.press([ball(force_n=force_n, radius_mm=radius_mm)])
        seen_mm = (truth.area_mm2 / np.pi) ** 0.5
        cells = (f"{radius_mm}", f"{force_n:.2f}", f"{truth.depth_mm:.3f}", f"{depth_mm:.3f}")
        more = (f"{seen_mm:.2f}", f"{contact_mm:.2f}", f"{1.2 * (radius_mm * depth_mm) ** 0.5:.2f}")
        lines.append("| " + " | ".join(cells + more) + " |")
    return lines


def _reading_table() -> list[str]:
    spearman = require("scipy.stats", driver="touch check", extra="lab").spearmanr
    gel = Gel(3)
    lines = [
        "| shape | seen from N | EDA over dent | EDA over touching area | with `contact` | centroid off px | "
        "rank correlation: EDA, area | CCI, depth |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name in SHAPES:
        found = [r for r in readings(name, gel) if r.eda]
        if len(found) < 2:
            lines.append(f"| {name} | not up to {FORCES_N[-1]} N | | | | | | |")
            continue
        ratios = [
            sorted(top / bottom for top, bottom in zip(tops, bottoms, strict=True))
            for tops, bottoms in (
                ([r.eda for r in found], [r.dent_px for r in found]),
                ([r.eda for r in found], [r.area_px for r in found]),
                ([r.eda_contact for r in found], [r.area_px for r in found]),
            )
        ]
        spans = [f"{np.median(r):.2f} [{r[0]:.2f}, {r[-1]:.2f}]" for r in ratios]
        same = len({r.area_px for r in found}) == 1
        area = (
            "same area"
            if same
            else f"{spearman(*zip(*((r.eda, r.area_px) for r in found), strict=True))[0]:.2f}"
        )
        depth = spearman([r.cci for r in found], [r.depth_mm for r in found]).statistic
        off = np.median([r.centre_off_px for r in found])
        cells = (name, f"{found[0].force_n}", *spans, f"{off:.1f}", area, f"{depth:.2f}")
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def _leftover_table() -> list[str]:
    lines = [
        "| force N | held s | creep | left at once | 0.13 s | 1 s | 2.7 s | 10 s | 30 s |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for force_n in (1.0, 5.0):
        for held_s in (0.5, 1.5, 5.0, 30.0):
            gel = Gel(0, spread=0.0, memory=True)
            first_mm = gel.press([ball(force_n=force_n)], t_s=0.0).depth_mm
            for frame in range(1, round(held_s * 60) + 1):
                gel.press([ball(force_n=force_n)], t_s=frame / 60)
            peak_mm = gel.truth.depth_mm
            left = []
            for after_s in (0.0, 0.13, 1.0, 2.7, 10.0, 30.0):
                gel.press([], t_s=held_s + after_s)
                left.append(f"{gel.displacement_mm().max() / peak_mm:.1%}")
            lines.append(
                "| " + " | ".join([f"{force_n}", f"{held_s}", f"{peak_mm / first_mm - 1:+.0%}", *left]) + " |"
            )
    return lines


def _match_table(matches: list[Match]) -> list[str]:
    lines = ["| statistic | recorded | simulated | off by, tolerances: median, most |", "|---|---|---|---|"]
    for name in TOLERANCES:
        recorded, simulated, off = (
            [getattr(match, field)[name] for match in matches] for field in ("recorded", "simulated", "off")
        )
        first = "–" if name.startswith("centroid") else f"{np.median(recorded):.3g}"
        cells = (name, first, f"{np.median(simulated):.3g}", f"{np.median(off):.2f}, {max(off):.2f}")
        lines.append("| " + " | ".join(cells) + " |")
    scores, correlations = [m.score for m in matches], [m.correlation for m in matches]
    return [
        *lines,
        "",
        f"score: median {np.median(scores):.2f}, worst {max(scores):.2f}; pixel correlation: median "
        f"{np.median(correlations):.2f}, worst {min(correlations):.2f}; RMS {np.median([m.rms for m in matches]):.1f}; "
        f"force {np.median([m.force_n for m in matches]):.1f} N",
    ]


def _spread(values: list[float]) -> str:
    low, middle, high = np.percentile(values, [10, 50, 90])
    return f"{middle:.2f} [{low:.2f}, {high:.2f}]"


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.argument(
    "out", type=click.Path(exists=True, file_okay=False, path_type=Path), default=Path("docs/images")
)
def main(out: Path) -> None:
    """Print the tables of docs/evidence/sim-touch.md and write its pictures into the folder OUT, else docs/images.

    Recorded presses are looked for in the folder that the variable TEGA_DATA names, else in ../shared/data.
    """
    from tega_figures.gel_figure import draw_presses, draw_readings

    sections = {
        "force and depth": _golden_table(),
        "touching radius": _radius_table(),
        "what live reads": _reading_table(),
        "left after release": _leftover_table(),
    }
    recordings = Path(os.environ.get("TEGA_DATA", "../shared/data")) / "digit"
    folder = recordings / "digit_ball_D20641"
    for title, name, table in (
        ("recorded disc", "digit_disc_force", disc_table),
        ("recorded grasps", "derived/digit_grasp_masks", grasp_table),
    ):
        there = (recordings / name).is_dir()
        sections[title] = (
            table(recordings / name) if there else [f"left out: no recordings at {recordings / name}"]
        )
    if folder.is_dir():
        presses, gel = load_presses(folder), Gel(0, spread=0.0)
        pairs = enumerate(zip(presses.frames, presses.marks, strict=True))
        matches = [match_press(frame, presses.still, mark, gel, index=100 * k) for k, (frame, mark) in pairs]
        sections["recorded presses"] = _match_table(matches)
        areas, touching, forces = (list(values) for values in zip(*like_presses(presses, gel), strict=True))
        sections["area at like difference"] = [
            f"live area over the marked circle's {_spread(areas)}, touching area over it {_spread(touching)}, "
            f"force {_spread(forces)} N"
        ]
    else:
        sections["recorded presses"] = [f"left out: no recordings at {folder}"]
    for title, lines in sections.items():
        click.echo("\n".join(["", f"## {title}", "", *lines]))
    draw_presses(out / "sim-touch.png")
    draw_readings(out / "sim-touch-readings.png")


if __name__ == "__main__":
    main()
