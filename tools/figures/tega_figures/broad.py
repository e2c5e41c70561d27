"""Compares recorded broad contacts of other DIGITs with simulated ones: a flat disc's press, and grasps.

No light was calibrated for these units, so that counts cannot be compared pixel by pixel. What is compared hangs less
on it: how much of the picture changes, how long the change is for its width, how steep it is against its mean, and how
the mean difference grows with force. The simulated gel was not fitted to any of it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.runtime.opencv import read_image
from tega_figures.check_touch import difference
from tega_figures.gel_sequences import pressing
from tega_sim.gel import Gel
from tega_sim.seams import Indenter

TOLERANCES: Final = {"share": 2.0, "elongation": 1.5, "mean": 1.5, "steepness": 1.5}
"""Factors within which medians of recorded and simulated statistics have to lie."""
DISC_MM: Final = 3.75
"""Radius of the simulated disc: the recorded one leaves a mark of 7 to 8 mm."""
# Counts of the difference's length: what drift and noise do not reach.
_CHANGED = 15.0
# A grasp's force is not known: these are the simulated ones, newtons.
_GRASPS = tuple(
    (name, force_n)
    for name in ("ball 4 mm", "ball 12 mm", "bar", "wall across", "wall along", "edge", "pad 5 x 5", "face")
    for force_n in (4.0, 8.0, 15.0)
)
_UNITS = (1, 2, 3, 4)


class Broad(NamedTuple):
    """What one difference picture is like."""

    share: float
    """Of the picture that changes by more than 15 counts."""
    elongation: float
    """Length over width of that, by second moments; 1 is round. NaN where less than a hundredth changes."""
    mean: float
    """Mean length of the difference, counts."""
    steepness: float
    """Largest (99.5 %) over mean length."""


def broad(frame: NDArray[np.uint8], still: NDArray[np.uint8]) -> Broad:
    """Measure a picture against the untouched one, both uint8 (320, 240, 3), BGR."""
    length = np.linalg.norm(difference(frame, still), axis=2)
    weight = length * (length > _CHANGED)
    share, mean = float((weight > 0).mean()), float(length.mean())
    elongation = float("nan")
    if share > 0.01:
        moments = np.cov(np.indices(length.shape).reshape(2, -1), aweights=weight.ravel())
        small, large = np.linalg.eigvalsh(moments)
        elongation = float(np.sqrt(large / small))
    return Broad(share, elongation, mean, float(np.percentile(length, 99.5)) / mean)


def recorded_disc(folder: Path) -> list[tuple[float, Broad]]:
    """Return force, newtons, and statistics of each picture of ``digit_disc_force``; the first is the baseline."""
    paths = sorted((folder / "images").glob("*.png"))
    frames = [read_image(path, driver="touch check") for path in paths]
    forces = [float((folder / "forces" / f"force_{path.stem}.txt").read_text().split()[0]) for path in paths]
    pairs = list(zip(forces, frames, strict=True))[1:]
    return [(force, broad(frame, frames[0])) for force, frame in pairs]


def simulated_disc(gel: Gel, forces_n: list[float], *, baseline_n: float) -> list[Broad]:
    """Press a disc, each picture against one that is pressed with another force already."""
    straight = np.hstack([np.eye(3), np.zeros((3, 1))])

    def press(force_n: float, index: int) -> NDArray[np.uint8]:
        return gel.frame([Indenter("cylinder", (DISC_MM, 3.0, 0.0), straight, force_n)], index)

    still = press(baseline_n, 0)
    return [broad(press(force_n, 1 + k), still) for k, force_n in enumerate(forces_n)]


def recorded_grasps(folder: Path) -> list[Broad]:
    """Return the statistics of each picture of ``derived/digit_grasp_masks``."""
    still = read_image(folder / "baseline.png", driver="touch check")
    return [
        broad(read_image(path, driver="touch check"), still) for path in sorted(folder.glob("frame_*.png"))
    ]


def simulated_grasps() -> list[Broad]:
    """Return the same of eight shapes pressed with 4 to 15 N into four units."""
    found = []
    for seed in _UNITS:
        gel = Gel(seed)
        untouched = gel.frame([], 1000)
        found += [broad(gel.frame(pressing(name, force_n), 1), untouched) for name, force_n in _GRASPS]
    return found
