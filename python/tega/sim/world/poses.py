"""The five closure poses of the bench, taught on its objects, and a controller that uses them."""

from __future__ import annotations

from typing import Final

import numpy as np

from tega.hand import CLOSURE_POSES_RAD, HandController

__all__ = ["GRASP_POSES_RAD", "hand_controller"]

# How far along the default poses' way (1 open to 5 tight) each of the bench's is. The defaults share the way out
# evenly, so that on an object of 80 to 110 mm three of five would not touch it; here the second already does.
_WAY: Final = (1.0, 3.9, 4.3, 4.65, 5.0)


def _along(way: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    before = min(int(way), 4)
    return CLOSURE_POSES_RAD[before - 1] + (way - before) * (
        CLOSURE_POSES_RAD[before] - CLOSURE_POSES_RAD[before - 1]
    )


GRASP_POSES_RAD: Final = np.array([_along(way) for way in _WAY])
"""Joint angles of levels 1 (open) to 5 (tight), float64 (5, 16); read-only."""
GRASP_POSES_RAD.flags.writeable = False


def hand_controller() -> HandController:
    """Return the real controller with the bench's poses; everything else is its default."""
    return HandController(poses_rad=GRASP_POSES_RAD)
