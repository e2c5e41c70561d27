"""Measure a forward movement of the forearm as it happens: how far it has gone, and when it is over."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from tega.arm.frames import FRAMES, turned
from tega.arm.heading import SHORTEST_M
from tega.arm.pose import StampedPose
from tega.errors import InvalidValueError

_REST_NS = 500_000_000
_REST_M = 0.01
_GAP_NS = 300_000_000


class ForearmSweep:
    """Collects poses until the forearm has moved and come to rest; restarts if the forearm is lost.

    Args:
        frame: Axes of the tracker, a name of :data:`~tega.arm.FRAMES`.
        yaw_rad: Direction of forward, as far as it is known.

    Attributes:
        done: Whether it has gone 10 cm or more and then rested for half a second.
        places: Where it was, in the tracker's axes, metres.

    Example:
        >>> sweep = ForearmSweep("openxr")
        >>> for k in range(100):
        ...     sweep.take(StampedPose(k * 10_000_000, (0, 0, -0.01 * min(k, 20)), (0, 0, 0, 1)))
        >>> sweep.done, sweep.gone_m.round(2).tolist()
        (True, [0.2, 0.0, 0.0])
    """

    def __init__(self, frame: str, *, yaw_rad: float = 0.0) -> None:
        if frame not in FRAMES:
            raise InvalidValueError(f"there is no frame {frame!r}", f"one of {', '.join(FRAMES)}")
        self._to_base = turned(-yaw_rad) @ FRAMES[frame]
        self._last_ns: int | None = None
        self._newest: deque[tuple[int, NDArray[np.float64]]] = deque()
        self.places: list[NDArray[np.float64]] = []
        self.done = False

    def take(self, pose: StampedPose) -> None:
        """Add the next pose; a lost or non-finite pose counts as no pose."""
        place = np.asarray(pose.position_m, np.float64)
        if self.done or not pose.valid or place.shape != (3,) or not np.isfinite(place).all():
            return
        if self._last_ns is not None and pose.t_ns - self._last_ns > _GAP_NS:
            self.places.clear()
            self._newest.clear()
        self._last_ns = pose.t_ns
        self.places.append(place)
        self._newest.append((pose.t_ns, place))
        while self._newest[0][0] < pose.t_ns - _REST_NS:
            self._newest.popleft()
        rested = pose.t_ns - self._newest[0][0] > 0.9 * _REST_NS and all(
            np.linalg.norm(there - place) < _REST_M for _, there in self._newest
        )
        self.done = rested and float(np.linalg.norm(self.gone_m)) >= SHORTEST_M

    @property
    def gone_m(self) -> NDArray[np.float64]:
        """Distance that the forearm has gone: forward, left, up, float64 (3,), metres."""
        if not self.places:
            return np.zeros(3)
        gone: NDArray[np.float64] = self._to_base @ (self.places[-1] - self.places[0])
        return gone
