"""Compare the simulated touch with its closed form, a published test and recorded presses; see sim-touch.md."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega import _native
from tega.runtime.lifecycle import require
from tega.runtime.opencv import read_image
from tega.tactile import read_contact
from tega_figures.audit import Mark, read_marks
from tega_figures.closeness import aimed_ball, difference
from tega_sim.gel import Gel, ball
from tega_sim.seams import Indenter

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
    area_px: int
    dent_px: int
    eda: int
    cci: float


def ball_press(radius_mm: float, contact_mm: float) -> tuple[float, float]:
    """Return depth, mm, and force, N, of a ball that touches over a disc: the model's closed form.

    A paraboloid z = r²/2R on a flat skin on springs, R ``radius_mm`` and a ``contact_mm``, the disc's radius:
    inside the contact the skin lies on it, outside it is a K₀(r/l) that joins it without a kink, so that d =
    a²/2R + (a l/R) K₀(a/l)/K₁(a/l). The springs carry F = k π [a² (d + 2 l²/R) - a⁴/4R].
    """
    special = require("scipy.special", driver="touch check", extra="lab")
    a, r, length = contact_mm, radius_mm, _native.GEL_LENGTH_MM
    depth = a * a / (2 * r) + a * length / r * special.k0e(a / length) / special.k1e(a / length)
    force = _native.GEL_STIFFNESS_N_MM3 * np.pi * (a * a * (depth + 2 * length**2 / r) - a**4 / (4 * r))
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
        dent = read_contact(image, still)
        dent_px = 16 * int((height > 0.2 * height.max()).sum())
        found.append(PressReading(force_n, truth.area_px, dent_px, dent.eda, dent.cci))
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

    Yields simulated area, ``live``, and simulated touching area, both over the marked circle's; and force.
    """
    for index, (frame, mark) in enumerate(zip(presses.frames, presses.marks, strict=True)):
        wanted = np.linalg.norm(difference(frame, presses.still), axis=2).mean()
        untouched, low, high = gel.frame([], index + 1_000), 0.1, 30.0
        for _ in range(9):
            force_n = float(np.sqrt(low * high))
            made = gel.frame([aimed_ball(gel, force_n=force_n, centre_xy=mark.centre_xy)], index)
            deeper = np.linalg.norm(difference(made, untouched), axis=2).mean() < wanted
            low, high = (force_n, high) if deeper else (low, force_n)
        inside = int((mark.distance(frame.shape) <= 1).sum())
        yield read_contact(made, untouched).eda / inside, gel.truth.area_px / inside, force_n
