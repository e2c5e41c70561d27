"""Set the bench's five closure poses, designed on its objects, and make a controller that uses them."""

from __future__ import annotations

from typing import Final

import numpy as np

from tega.hand import HandController

# Levels 1 (open) to 5 (tight): a finger's joints, the thumb's. Open, but no wider than the objects ask for. From level
# 2 on pads meet the objects (`tega_figures.pads.design` of 219d27ec); levels 3 to 5 were made firmer by hand, as far as
# no joint has more than 0.219, 0.287 and 0.384 torque units, the largest with the poses of before.
_LEVELS_RAD: Final = (
    ((0.0, 0.500, 0.400, 0.300), (1.35, 0.200, -0.140, 0.400)),
    ((0.0, 1.045, 0.954, 0.477), (1.35, 0.033, 0.224, 0.981)),
    ((0.0, 1.165, 1.055, 0.490), (1.35, 0.050, 0.598, 1.100)),
    ((0.0, 1.190, 1.142, 0.470), (1.35, 0.097, 0.720, 1.120)),
    ((0.0, 1.315, 1.180, 0.460), (1.35, 0.230, 0.820, 1.170)),
)


def _grasp_poses() -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    poses = np.array([(*finger, *finger, *finger, *thumb) for finger, thumb in _LEVELS_RAD])
    poses.flags.writeable = False
    return poses


GRASP_POSES_RAD: Final = _grasp_poses()
"""Joint angles of levels 1 (open) to 5 (tight), float64 (5, 16); read-only."""


def hand_controller() -> HandController:
    """Return the real controller with the bench's poses; everything else is its default."""
    return HandController(poses_rad=GRASP_POSES_RAD)
