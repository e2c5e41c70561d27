"""How much relief pictures of contacts show, recorded and simulated, and how well its slide is read.

::

    python -m tega_figures.slide                                   # tables of docs/evidence/sim-touch.md
    python -m tega_figures.slide --recorded ../shared/data/digit   # those of recordings

All that is not named recorded is simulated.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from tega.tactile.shear import ShearReader
from tega.tactile.tracker import TouchTracker
from tega_figures.shear import recorded_grips
from tega_sim.gel import PX_PER_MM, Gel
from tega_sim.seams import Indenter

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["RELIEF_COUNTS", "SlideCourse", "SlideStep", "fine", "main", "slid", "speeding", "wall"]

RELIEF_COUNTS: Final = 1.0
"""Contrast of the relief that ``check_events --relief`` was run with: a third of a recorded printed disc's."""

FRICTION: Final = 0.6
RADIUS_MM: Final = 40.0
_PRESSED: Final = 30
_STEP = 3
# The recorded disc's pictures trail its force by about two frames (its folder's README).
_LAG = 2


class SlideStep(NamedTuple):
    """What a frame has of a wall before the gel.

    Attributes:
        load_n: How it is pressed on.
        way_mm: How far it has slid over the gel.
        share: Its pull over what friction bears.
    """

    load_n: float
    way_mm: float
    share: float


def wall(step: SlideStep, counts: float, *, y_mm: float | None = None) -> Indenter:
    """Return the wall of a bottle along the picture, which slides along itself; or across it, at a height of it."""
    along = y_mm is None
    pose = (
        np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, step.way_mm], [0.0, -1.0, 0.0, RADIUS_MM]])
        if along
        else np.array(
            [[0.0, 0.0, 1.0, step.way_mm], [1.0, 0.0, 0.0, y_mm or 0.0], [0.0, 1.0, 0.0, RADIUS_MM]]
        )
    )
    pull_n = step.share * FRICTION * step.load_n
    return Indenter(
        "capsule",
        (RADIUS_MM, 80.0, 0.0),
        pose,
        step.load_n,
        (0.0, pull_n) if along else (pull_n, 0.0),
        FRICTION,
        counts,
    )


class SlideCourse(NamedTuple):
    """What is read of a wall's course.

    Attributes:
        speed_mm_s: Of the slide, each frame; shape ``(n,)``.
        sure: Of that; shape ``(n,)``.
    """

    speed_mm_s: NDArray[np.float64]
    sure: NDArray[np.float64]


def slid(seed: int, steps: Sequence[SlideStep], counts: float, *, y_mm: float | None = None) -> SlideCourse:
    """Read a course frame by frame, sixty a second, on a gel with shear texture."""
    gel = Gel(seed, memory=True, shear="texture")
    baseline = np.rint(np.mean([gel.frame([], n) for n in range(30)], axis=0)).astype(np.uint8)
    tracker, reader = TouchTracker(baseline), ShearReader(baseline, mm_per_px=1 / PX_PER_MM)
    read = []
    for n, step in enumerate(steps):
        image = gel.frame([wall(step, counts, y_mm=y_mm)] if step.load_n else [], 30 + n)
        touches = tracker.update(image).in_contact
        one = reader.update(image, tracker)
        read.append((one.slide_mm_s, one.slide_sure) if touches else (0.0, 0.0))
    values = np.array(read)
    return SlideCourse(values[:, 0], values[:, 1])


def speeding(load_n: float, mm_s: float, *, frames: int = 24, share: float = 0.3) -> list[SlideStep]:
    """Return a wall that is pressed on within 0.2 s, rests, and slides: faster and faster for 0.1 s, then evenly."""
    steps = [SlideStep(load_n * min((n + 1) / 12, 1.0), 0.0, 0.0) for n in range(_PRESSED)]
    speed, way = 0.0, 0.0
    for _ in range(frames):
        speed = min(speed + mm_s / 6, mm_s)
        way += speed / 60
        steps.append(SlideStep(load_n, way, share))
    return steps


def fine(image: NDArray[Any]) -> NDArray[np.float64]:
    """Return fine contrast as the slide's reading sees it, counts of grey: 2 x 2 pixels less their neighbours."""
    grey: NDArray[np.float64] = image.astype(np.float64) @ np.array([0.114, 0.587, 0.299])
    half = (grey[::2, ::2] + grey[1::2, ::2] + grey[::2, 1::2] + grey[1::2, 1::2]) / 4
    out, s = np.zeros_like(half), _STEP
    around = half[: -2 * s, s:-s] + half[2 * s :, s:-s] + half[s:-s, : -2 * s] + half[s:-s, 2 * s :]
    out[s:-s, s:-s] = half[s:-s, s:-s] - around / 4
    return out


def _shared(one: NDArray[Any], two: NDArray[Any], mask: NDArray[np.bool_]) -> float:
    """Return the covariance of two pictures' fine contrast, which noise has no part in, counts of grey squared."""
    return float(np.cov(fine(one)[mask], fine(two)[mask])[0, 1])


def _root(square: float) -> float:
    return math.copysign(math.sqrt(abs(square)), square)


def _disc(radius_px: float, middle: tuple[float, float]) -> NDArray[np.bool_]:
    y, x = np.mgrid[:160, :120] * 2.0 + 0.5
    inside: NDArray[np.bool_] = np.hypot(x - middle[0], y - middle[1]) < radius_px
    return inside


def _contrasts(folder: Path) -> Iterable[str]:
    import cv2

    yield "| contact | picture | fine contrast inside, counts of grey | beside it | of the object |"
    yield "|---|---|---|---|---|"
    beside = np.zeros((160, 120), dtype=np.bool_)
    beside[5:30, 5:-5] = beside[125:-5, 5:-5] = True
    files = sorted((folder / "digit_disc_force/images").glob("*.png"))
    pictures = [np.asarray(cv2.imread(str(file))) for file in files]
    inside = _disc(42.0, (128.0, 145.0))
    for k in (3, 4, 5, 8, 12, 20):
        force_n = abs(np.loadtxt(folder / f"digit_disc_force/forces/force_{files[k - _LAG].stem}.txt")).max()
        one, two = (
            _shared(pictures[k], pictures[k + 1], inside),
            _shared(pictures[k], pictures[k + 1], beside),
        )
        yield (
            f"| recorded DIGIT: printed disc, {force_n:.1f} N | {files[k].stem} | {_root(one):.2f} | {_root(two):.2f} "
            f"| {_root(one - two):.2f} |"
        )
    for name in ("off", "relief"):
        for force_n in (3.1, 5.9, 11.8):
            gel = Gel(1, shear="texture", spread=0.0, shape="flat")
            pose = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 5.0]])
            counts = RELIEF_COUNTS if name == "relief" else 0.0
            disc = Indenter("cylinder", (2.9, 5.0, 0.0), pose, force_n, (0.0, 0.0), FRICTION, counts)
            shown = [gel.frame([disc], n) for n in range(20)]
            inner = _disc(35.0, (119.5, 159.5))
            one = float(np.mean([_shared(a, b, inner) for a, b in zip(shown[::2], shown[1::2], strict=True)]))
            two = float(
                np.mean([_shared(a, b, beside) for a, b in zip(shown[::2], shown[1::2], strict=True)])
            )
            yield (
                f"| simulated: disc, {'smooth' if name == 'off' else f'relief of {RELIEF_COUNTS:g}'}, {force_n} N "
                f"| mean of 10 pairs | {_root(one):.2f} | {_root(two):.2f} | {_root(one - two):.2f} |"
            )
    rows = list(csv.reader((folder / "digit_ball_D20641/annotate.csv").open()))[1:]
    excess = []
    for path, x, y, radius in (row[:4] for row in rows):
        image = np.asarray(cv2.imread(str(folder / "digit_ball_D20641" / Path(path).name)))
        middle = (float(x), float(y))
        inner = _disc(0.55 * float(radius), middle) & _disc(1e9, middle)
        far = ~_disc(2.2 * float(radius), middle)
        for mask in (inner, far):
            mask[:5] = mask[-5:] = False
            mask[:, :5] = mask[:, -5:] = False
        if inner.sum() > 400:
            excess.append(fine(image)[inner].var() - fine(image)[far].var())
    yield (
        f"| recorded DIGIT: ball, {len(excess)} presses, one picture each, so with noise | median | – | – "
        f"| {_root(float(np.median(excess))):.2f} |"
    )


def _grips(folder: Path) -> Iterable[str]:
    yield "| grip | frames in contact | slide told in | speed told, mm/s: median, 95 % | sure: median |"
    yield "|---|---|---|---|---|"
    for name, read in recorded_grips(folder):
        speeds = [(one.slide_mm_s, one.slide_sure) for one in read]
        told = np.array([row for row in speeds if row[1] > 0]).reshape(-1, 2)
        if not len(told):
            yield f"| recorded: {name} | {len(read)} | 0.00 | – | – |"
            continue
        speed = np.quantile(told[:, 0], [0.5, 0.95])
        yield (
            f"| recorded: {name} | {len(read)} | {len(told) / len(read):.2f} | {speed[0]:.1f}, {speed[1]:.1f} "
            f"| {np.median(told[:, 1]):.2f} |"
        )


def _reading() -> Iterable[str]:
    yield "| wall | relief, counts | load N | slide, mm/s | told in | off, mm/s: median, 95 % |"
    yield "|---|---|---|---|---|---|"
    for name, y_mm in (("along the picture", None), ("across its upper border", -9.0)):
        for counts in (0.0, 0.5, 1.0, 1.5):
            for load_n in (1.5, 3.0):
                for mm_s in (0.0, 6.0, 12.0, 30.0) if counts else (6.0,):
                    courses = [
                        slid(seed, speeding(load_n, mm_s), counts, y_mm=y_mm) for seed in range(20, 26)
                    ]
                    speed = np.concatenate([one.speed_mm_s[_PRESSED + 9 :] for one in courses])
                    told = np.concatenate([one.sure[_PRESSED + 9 :] for one in courses]) > 0
                    off = np.abs(speed[told] - mm_s)
                    cell = f"{np.median(off):.1f}, {np.quantile(off, 0.95):.1f}" if len(off) else "–"
                    yield f"| {name} | {counts:g} | {load_n:g} | {mm_s:g} | {told.mean():.2f} | {cell} |"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description="Relief in contacts, and the slide that is read of it.")
    parser.add_argument("--recorded", type=Path, help="folder of the shared recordings of fingertips")
    asked = parser.parse_args()
    tables = [_reading()] if asked.recorded is None else [_contrasts(asked.recorded), _grips(asked.recorded)]
    for table in tables:
        sys.stdout.writelines(line + "\n" for line in table)
        sys.stdout.write("\n")


if __name__ == "__main__":
    main()
