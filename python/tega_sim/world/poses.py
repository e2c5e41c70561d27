"""Set the bench's five closure poses, taught on its objects, and make a controller that uses them."""

from __future__ import annotations

from typing import Final

import numpy as np

from tega.hand import CLOSURE_POSES_RAD, HandController

# Open, but no wider than the objects ask for: no joint is 0.59 rad or more from the next level, so that a move
# from one level to the next keeps its 0.6 s.
_OPEN_RAD: Final = ((0.0, 0.50, 0.40, 0.30), (1.35, 0.20, -0.14, 0.15))
# Fingers: how far along the default poses' way (1 open to 5 tight) levels 2 to 5 of the bench are. The defaults share
# the way out evenly, so that on an object of 80 to 100 mm three of five would not touch it; here the second does.
_REMEDY: Final = (3.9, 4.3, 4.65, 5.0)
# The thumb meets the object with its pad, opposite the index and middle fingers; the default thumb reaches past it.
_THUMB_RAD: Final = (
    (1.35, 0.20, 0.30, 0.70),
    (1.35, 0.20, 0.35, 0.90),
    (1.35, 0.20, 0.40, 1.10),
    (1.35, 0.20, 0.45, 1.30),
)


def _grasp_poses() -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    finger, thumb = _OPEN_RAD
    poses = np.empty((5, 16))
    poses[0] = (*finger, *finger, *finger, *thumb)
    for row, route in enumerate(_REMEDY, start=1):
        before = min(int(route), 4)
        low, high = CLOSURE_POSES_RAD[before - 1 : before + 1]
        poses[row] = low + (route - before) * (high - low)
    poses[1:, 12:] = _THUMB_RAD
    poses.flags.writeable = False
    return poses


GRASP_POSES_RAD: Final = _grasp_poses()
"""Joint angles of levels 1 (open) to 5 (tight), float64 (5, 16); read-only."""


def hand_controller() -> HandController:
    """Return the real controller with the bench's poses; everything else is its default."""
    return HandController(poses_rad=GRASP_POSES_RAD)
