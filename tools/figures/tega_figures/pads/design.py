"""Design the closure poses of levels 2 to 5 so that the pads meet the objects, with the forces of given poses.

``python -m tega_figures.pads.design poses.toml`` writes a pose file for ``hand.poses``. It takes some ten minutes.

The poses are found by least squares over simulated holds of every object (:mod:`tega_figures.pads.grip`): the three
fingers bend alike, abduction stays 0 and the thumb fully opposed. What is made small:

* how far a contact lies from the middle of its pad, above all more than 3 mm,
* the difference of the pads' forces from those with the reference poses, and what narrowing, slip and torques exceed
  of theirs,
* how unevenly joints go from level to level, and steps between levels that would take longer than 0.6 s.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.optimize import least_squares

from tega.hand import JOINT_LIMITS_RAD
from tega.hand.poses import POSE_MARGIN_RAD, load_poses, save_poses
from tega_figures.pads.grip import Held, grip
from tega_sim.world.objects import OBJECTS
from tega_sim.world.poses import GRASP_POSES_RAD

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["design"]

_LEVELS: Final = (2, 3, 4, 5)
_SEEDS: Final = (0,)
# The joints that bend: of a finger, of the thumb.
_FREE: Final = [1, 2, 3, 13, 14, 15]
_MIDDLE_MM: Final = 3.0
_STEP_RAD: Final = 0.59
_DIFFERENCE_RAD: Final = 0.02


def design(
    reference_rad: NDArray[np.float64], start_rad: NDArray[np.float64], *, most_rounds: int = 20
) -> NDArray[np.float64]:
    """Return designed poses, float64 (5, 16), rad; level 1 is that of the start.

    ``reference_rad`` are the poses whose forces are to be kept, ``start_rad`` those to begin with, (5, 16);
    ``most_rounds`` limits the steps of the least squares.
    """
    before = [_grips(level, reference_rad) for level in _LEVELS]

    def poses(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return _poses(x.reshape(len(_LEVELS), -1), start_rad[0])

    def holds(x: NDArray[np.float64], first: int = 0) -> NDArray[np.float64]:
        """Return what is wrong with the holds from one level on, (levels, n)."""
        now = [_grips(level, poses(x)) for level in _LEVELS[first:]]
        pairs = [zip(*level, strict=True) for level in zip(now, before[first:], strict=True)]
        return np.array([np.concatenate([_missed(*pair) for pair in level]) for level in pairs])

    def residuals(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.concatenate([holds(x).ravel(), _uneven(poses(x))])

    def slopes(x: NDArray[np.float64]) -> NDArray[np.float64]:
        here, columns = holds(x), []
        for k in range(x.size):
            way = np.zeros(x.size)
            way[k] = _DIFFERENCE_RAD
            # The hand passes a level on its way to those above it, not to those below.
            first, moved = k // len(_FREE), np.array(here)
            moved[first:] = holds(x + way, first)
            uneven = _uneven(poses(x + way)) - _uneven(poses(x))
            columns.append(np.concatenate([(moved - here).ravel(), uneven]) / _DIFFERENCE_RAD)
        return np.array(columns).T

    inside = POSE_MARGIN_RAD + 2 * _DIFFERENCE_RAD
    low, high = (np.tile(JOINT_LIMITS_RAD[_FREE, side], len(_LEVELS)) for side in (0, 1))
    start = np.clip(start_rad[1:, _FREE].ravel(), low + inside + 1e-3, high - inside - 1e-3)
    found = least_squares(
        residuals,
        start,
        slopes,
        bounds=(low + inside, high - inside),
        x_scale=0.1,
        max_nfev=most_rounds,
        verbose=2,
    )
    return poses(found.x)


def _poses(angles_rad: NDArray[np.float64], open_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    poses = np.tile(open_rad, (5, 1))
    for finger in range(3):
        poses[1:, 4 * finger + 1 : 4 * finger + 4] = angles_rad[:, :3]
    poses[1:, 13:] = angles_rad[:, 3:]
    return poses


def _grips(level: int, poses_rad: NDArray[np.float64]) -> list[Held]:
    return [grip(name, level, poses_rad, seed=seed) for name in OBJECTS for seed in _SEEDS]


def _missed(now: Held, before: Held) -> NDArray[np.float64]:
    """Return what is wrong with a hold, each in its own measure: 1 is much."""
    loaded = np.clip(now.forces_n / 0.3, 0, 1)
    beyond = np.maximum(0, np.abs(now.along_mm) - _MIDDLE_MM)
    pads = [
        (one - other) / max(other, 1.0)
        for a, b in ((now.gripped_n, before.gripped_n), (now.forces_n, before.forces_n))
        for one, other in ((a[0], b[0]), (a[1:].sum(), b[1:].sum()))
    ]
    excess = (
        3 * (now.narrowing_mm / max(before.narrowing_mm, 1.0) - 1.03),
        10 * (now.torques.max() - before.torques.max()),
        3 * (now.torques.sum() / before.torques.sum() - 1),
        2 * np.log1p(max(0.0, now.slip_mm - before.slip_mm)),
    )
    lost = 2.0 * (before.held and not now.held)
    return np.array(
        [
            *(loaded * beyond),
            *(loaded * now.along_mm / 8),
            *(loaded * now.across_mm / 8),
            *(np.array([1.5, 3.0, 1.0, 2.0]) * pads),
            *np.maximum(0, excess),
            lost,
        ]
    )


def _uneven(poses_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    steps = np.diff(poses_rad[:, _FREE], axis=0)
    bends = np.diff(steps[1:], axis=0)
    return np.concatenate([bends.ravel(), 30 * np.maximum(0, np.abs(steps) - _STEP_RAD).ravel()])


def main() -> None:
    """Design poses and write the file."""
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("out", type=Path, help="pose file to write")
    words.add_argument(
        "--reference", type=Path, help="pose file whose forces are kept; none: the bench's poses"
    )
    words.add_argument("--start", type=Path, help="pose file to begin with; none: the reference")
    words.add_argument("--rounds", type=int, default=20, help="steps of the least squares")
    given = words.parse_args()
    reference = GRASP_POSES_RAD if given.reference is None else load_poses(given.reference)
    start = reference if given.start is None else load_poses(given.start)
    save_poses(given.out, design(reference, start, most_rounds=given.rounds))


if __name__ == "__main__":
    main()
