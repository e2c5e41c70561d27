"""Compare the simulated touch with its closed form, a published test and recorded presses; see sim-touch.md.

Recorded and simulated presses are compared by the same statistics of both difference pictures, and a score. A
difference picture is frame minus untouched gel, each channel's median taken out, smoothed over 1.5 pixels; its length
is that of (B, G, R) in counts. Each statistic has a tolerance as a ratio or in its own unit; the score is the median of
what the statistics are off by, in tolerances: 1 or less is close.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.runtime.lifecycle import require
from tega.runtime.opencv import read_image
from tega.tactile import read_contact
from tega_figures.audit import Mark, read_marks
from tega_figures.audit.truth import FAR_RADII
from tega_sim.gel import LENGTH_MM, STIFFNESS_N_MM3, Gel, ball
from tega_sim.seams import Indenter

Image = NDArray[np.uint8]

# Statistic: tolerance of |ln(simulated / recorded)|; the last three are of the plain difference.
TOLERANCES = {
    "max length": 0.25,
    "99.5 % length": 0.25,
    "mean length": 0.2,
    "share > 15": 0.25,
    "share > 25": 0.25,
    "B 99.8 %": 0.35,
    "B 0.2 %": 0.35,
    "G 99.8 %": 0.35,
    "G 0.2 %": 0.35,
    "R 99.8 %": 0.35,
    "R 0.2 %": 0.35,
    "B noise": 0.1,
    "G noise": 0.1,
    "R noise": 0.1,
    "far difference": 0.15,
    "live area": 0.25,
    "noise lag 1": 0.1,
    "noise lag 4": 0.1,
    "centroid, px": 6.0,
}
_PLAIN = ("noise lag 1", "noise lag 4", "centroid, px")
# Below this a share or an extreme is 0 for practical purposes; keeps logarithms finite.
_LEAST = 1e-3


class Match(NamedTuple):
    """A recorded press and the simulated one that is most like it."""

    force_n: float
    """Of the simulated press."""
    centre_xy: tuple[float, float]
    """Of the simulated press, pixels."""
    correlation: float
    """Of the two difference pictures, within two marked radii."""
    rms: float
    """Of their difference over the picture, counts."""
    recorded: dict[str, float]
    simulated: dict[str, float]
    off: dict[str, float]
    """By how many tolerances each statistic differs."""
    score: float
    """Median of ``off``."""
    true_area_px: int
    """Touching area of the simulated press."""


def difference(frame: Image, still: Image) -> NDArray[np.float32]:
    """Return the smoothed difference picture, float32 (H, W, 3), counts."""
    return _smooth(_offset_free(frame, still), 1.5)


def statistics(frame: Image, still: Image, mark: Mark) -> dict[str, float]:
    """Measure a press: one number for each of :data:`TOLERANCES`.

    ``frame`` is uint8 (H, W, 3), ``still`` the untouched gel, with a camera's noise. ``mark`` is about where
    the contact is: what lies further than 2.4 of its radii is taken for untouched.
    """
    raw = _offset_free(frame, still)
    smooth = _smooth(raw, 1.5)
    length = np.sqrt((smooth**2).sum(axis=2))
    far = mark.distance(frame.shape) > FAR_RADII
    found = {
        "max length": length.max(),
        "99.5 % length": np.percentile(length, 99.5),
        "mean length": length.mean(),
        "share > 15": (length > 15).mean(),
        "share > 25": (length > 25).mean(),
    }
    for k, name in enumerate("BGR"):
        found[f"{name} 99.8 %"] = np.percentile(smooth[..., k], 99.8)
        found[f"{name} 0.2 %"] = -np.percentile(smooth[..., k], 0.2)
    # Two noisy pictures were subtracted.
    noise = (raw - _smooth(raw, 6.0)) / np.sqrt(2)
    for k, name in enumerate("BGR"):
        found[f"{name} noise"] = noise[..., k][far].std()
    found["far difference"] = np.abs(raw)[far].mean()
    for lag in (1, 4):
        both = far[:, lag:] & far[:, :-lag]
        products = (noise[:, lag:] * noise[:, :-lag])[both].mean(axis=0)
        found[f"noise lag {lag}"] = (products / (noise[far] ** 2).mean(axis=0)).mean()
    live = read_contact(frame, still)
    found["live area"] = live.eda
    # Its place is compared, not measured: `match_press` fills the distance in.
    found["centroid, px"] = 0.0
    return {name: float(value) for name, value in found.items()}


def match_press(frame: Image, still: Image, mark: Mark, gel: Gel, *, index: int) -> Match:
    """Find the ball press whose difference picture is most like a recorded one, and compare the two.

    Force and place are fitted, three numbers a press; light, noise and the gel are not. ``frame`` is a
    recorded press of a ball of 8.8 mm, ``still`` the recorded untouched gel, ``mark`` the recorded circle,
    where the search starts; ``gel`` is the unit to press, ``index`` the number of the simulated frame.
    """
    minimize = require("scipy.optimize", driver="touch check", extra="lab").minimize
    wanted = difference(frame, still)
    untouched = gel.frame([], index + 1_000)
    near = mark.distance(frame.shape) < 2

    def distance(trial: NDArray[np.float64]) -> float:
        x, y, root = trial
        made = gel.frame([ball(force_n=min(root * root, 50.0), centre_xy=(x, y), on=gel)], index)
        return float(((difference(made, untouched) - wanted)[near] ** 2).mean())

    start = np.array([*mark.centre_xy, 2.0])
    simplex = start + np.array([[0, 0, 0], [6, 0, 0], [0, 6, 0], [0, 0, 0.5]])
    options = {"initial_simplex": simplex, "xatol": 0.05, "fatol": 0.05, "maxfev": 120}
    x, y, root = minimize(distance, start, method="Nelder-Mead", options=options).x
    made = gel.frame([ball(force_n=root * root, centre_xy=(x, y), on=gel)], index)
    simulated, recorded = statistics(made, untouched, mark), statistics(frame, still, mark)
    places = [np.array(read_contact(a, b).centroid_xy) for a, b in ((made, untouched), (frame, still))]
    simulated["centroid, px"] = float(np.hypot(*(places[0] - places[1])))
    off = {
        name: abs(simulated[name] - recorded[name]) / tolerance
        if name in _PLAIN
        else abs(np.log(max(simulated[name], _LEAST) / max(recorded[name], _LEAST))) / tolerance
        for name, tolerance in TOLERANCES.items()
    }
    displayed = difference(made, untouched)
    return Match(
        force_n=float(root * root),
        centre_xy=(float(x), float(y)),
        correlation=float(np.corrcoef(displayed[near].ravel(), wanted[near].ravel())[0, 1]),
        rms=float(np.sqrt(((displayed - wanted) ** 2).mean())),
        recorded=recorded,
        simulated=simulated,
        off=off,
        score=float(np.median(list(off.values()))),
        true_area_px=gel.truth.area_px,
    )


def _offset_free(frame: Image, still: Image) -> NDArray[np.float32]:
    raw = frame.astype(np.float32) - still
    free: NDArray[np.float32] = raw - np.median(raw, axis=(0, 1))
    return free


def _smooth(picture: NDArray[np.float32], sigma_px: float) -> NDArray[np.float32]:
    filters = require("scipy.ndimage", driver="touch check", extra="lab")
    smooth: NDArray[np.float32] = filters.gaussian_filter(picture, (sigma_px, sigma_px, 0), truncate=3)
    return smooth


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
            made = gel.frame([ball(force_n=force_n, centre_xy=mark.centre_xy, on=gel)], index)
            deeper = np.linalg.norm(difference(made, untouched), axis=2).mean() < wanted
            low, high = (force_n, high) if deeper else (low, force_n)
        inside = int((mark.distance(frame.shape) <= 1).sum())
        yield read_contact(made, untouched).eda / inside, gel.truth.area_px / inside, force_n
