"""Where a person's fingers are: to be recorded and drawn, never to steer.

The hand is steered by muscles alone. No module on the way to a command imports this one, which
``tests/unit/test_limb_loss.py`` proves for every import there is; a type of its own keeps such a value from passing for
another.
"""

from __future__ import annotations

from typing import final

import numpy as np
from numpy.typing import NDArray

from tega.errors import ShapeError

__all__ = ["FingerTracking"]


@final
class FingerTracking:
    """The joints of a person's hand as a tracker sees them.

    It is no tuple, number or array, so nothing that computes takes it by accident.

    Args:
        t_ns: When they were seen, nanoseconds.
        joints_m: float64 (n, 3), metres.

    Raises:
        ShapeError: ``joints_m`` is not (n, 3).
    """

    __slots__ = ("_joints_m", "t_ns")

    def __init__(self, t_ns: int, joints_m: NDArray[np.float64]) -> None:
        if joints_m.ndim != 2 or joints_m.shape[1] != 3:
            raise ShapeError(f"joints_m has shape {joints_m.shape}, not (n, 3)")
        self.t_ns = t_ns
        self._joints_m = joints_m

    def for_recording(self) -> NDArray[np.float64]:
        """Return the joints, float64 (n, 3), metres, to be written down or drawn."""
        return self._joints_m
