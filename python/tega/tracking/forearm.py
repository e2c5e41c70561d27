"""Where a person's forearm is: the only part of a person's tracking that control may take."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["ForearmPose"]


class ForearmPose(NamedTuple):
    """Place and direction of a forearm; it says nothing of wrist, hand or fingers.

    Attributes:
        t_ns: When it was seen, nanoseconds.
        position_m: Of the wrist, x, y, z, metres.
        quaternion_wxyz: Direction of the forearm, unit length.
    """

    t_ns: int
    position_m: tuple[float, float, float]
    quaternion_wxyz: tuple[float, float, float, float]
