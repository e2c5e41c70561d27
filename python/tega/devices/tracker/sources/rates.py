"""Sum up the speeds that a device such as a SpaceMouse gives, for forearm poses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from tega.arm.pose import StampedPose
from tega.arm.rotation import IDENTITY, exp, multiply, unit
from tega.runtime.device_items import InputReading

# A pose is told once in so long at most, as a tracker would; the summing goes on between.
_LEAST_NS: Final = 1_000_000
# After a longer pause the deflection of before is not summed up: nobody knows how long it lasted.
_LONGEST_S: Final = 0.1


class RatePoses:
    """Sums up the motion of an input device to the pose of a forearm that is not there.

    ``position += speed · shape(motion) dt`` along the base's axes, and the same for the rotation, with ``shape(u) = u
    |u|²``: fine near rest, full speed at full deflection. While the device says "no data" the pose is not valid, so
    that the chain holds. Such a device needs a dead-man switch (a button held) but no clutch of its own.

    Args:
        state: Returns the device's newest state, such as :meth:`tega.devices.input.spacemouse.SpaceMouse.state`.
        speed_m_s: At full deflection.
        turn_rad_s: At full deflection.

    Example:
        >>> still = InputReading(0, True, (0.0,) * 6, frozenset())
        >>> RatePoses(lambda: still).read(0)[0].position_m
        [0.0, 0.0, 0.0]
    """

    frame: Final = "base"

    def __init__(
        self, state: Callable[[], InputReading], *, speed_m_s: float = 0.15, turn_rad_s: float = 0.6
    ) -> None:
        self._state = state
        self._speeds = np.array([speed_m_s] * 3 + [turn_rad_s] * 3)
        self._place, self._turn = np.zeros(3), IDENTITY
        self._last_ns: int | None = None

    def read(self, now_ns: int) -> Sequence[StampedPose]:
        """Return one pose, of now; none within a millisecond of the last."""
        if self._last_ns is not None and now_ns - self._last_ns < _LEAST_NS:
            return ()
        dt_s = 0.0 if self._last_ns is None else (now_ns - self._last_ns) / 1e9
        self._last_ns = now_ns
        state = self._state()
        if state.live and dt_s <= _LONGEST_S:
            motion = np.array(state.motion)
            route = self._speeds * motion * np.abs(motion) ** 2 * dt_s
            self._place = self._place + route[:3]
            self._turn = unit(multiply(exp(route[3:]), self._turn))
        return (StampedPose(now_ns, self._place.tolist(), self._turn.tolist(), valid=state.live),)
