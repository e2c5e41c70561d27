"""Define the arm chain's data: stamped poses and their source, places and turns, and the command to the arm."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

ArmState = Literal["idle", "following", "holding", "stopped"]


class StampedPose(NamedTuple):
    """One measured rigid pose of the operator's forearm, or of the arm's own hand.

    It has no fields for fingers, so finger tracking cannot reach the arm.

    Attributes:
        t_ns: When it was so, on the machine's monotonic clock.
        position_m: x, y, z in the frame of the measuring device.
        quaternion_xyzw: Its turn, x, y, z, w.
        valid: Validity according to the source: false if the pose was lost, guessed or extrapolated.
    """

    t_ns: int
    position_m: Sequence[float] | NDArray[np.float64]
    quaternion_xyzw: Sequence[float] | NDArray[np.float64]
    valid: bool = True


class Pose(NamedTuple):
    """Place, float64 (3,), and unit turn, float64 (4,), in the base's axes: x forward, y left, z up."""

    position_m: NDArray[np.float64]
    quaternion_xyzw: NDArray[np.float64]


class ArmCommand(NamedTuple):
    """Command to the arm: its state, its target and the target's speed in the base's axes, float64 (3,).

    Attributes:
        t_ns: When, by the caller's clock.
        state: ``idle`` (not steered), ``following``, ``holding`` (it would follow, but something is missing)
            or ``stopped`` (the driver ends with damping and without force; a person has to allow it to go
            on).
        reason: Why it is so, for the operator.
        target: Where the hand shall be; ``None`` asks nothing of the arm.
        engagements: How often the operator has taken hold; a driver refuses a lower number than its own.
    """

    t_ns: int
    state: ArmState
    reason: str
    target: Pose | None
    velocity_m_s: NDArray[np.float64]
    velocity_rad_s: NDArray[np.float64]
    engagements: int


class PoseSource(Protocol):
    """Source of forearm poses."""

    def read(self, now_ns: int) -> Sequence[StampedPose]:
        """Return the poses since the last call, oldest first; never waits. ``now_ns``: the stamps' clock."""
