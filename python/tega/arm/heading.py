"""Calibrate the operator's forward direction (yaw) by a movement of the forearm, followed as it happens."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega.arm.frames import FRAMES, turned
from tega.arm.pose import StampedPose
from tega.errors import CalibrationError, InvalidValueError

SHORTEST_M = 0.10
LEAST_STRAIGHT = 0.8
STEEPEST_RAD = math.radians(30)
MOST_OFF_RAD = math.radians(15)
_REST_NS = 500_000_000
_REST_M = 0.01
_GAP_NS = 300_000_000


class ForwardCheck(NamedTuple):
    """Verdict on a forward movement, as the robot sees it, with a message to the operator (``words``).

    ``off_rad`` is by how much it points to the left (positive) or right of forward.
    """

    ok: bool
    off_rad: float
    words: str


def yaw_from_sweep(positions: ArrayLike, *, frame: str) -> float:
    """Return the heading of a movement of the forearm that the operator calls forward.

    ``positions`` (n, 3), metres, are places of the tracker meanwhile, in its axes ``frame``, a name of
    :data:`~tega.arm.FRAMES`. The result is ``yaw_rad`` for :class:`~tega.arm.MappingSettings`: about the vertical,
    from -π to π. ``CalibrationError`` says whether the movement was too short, not straight or not level.

    Example:
        >>> yaw_from_sweep([[0, 0, 0], [0, 0, -0.1], [0, 0, -0.2]], frame="openxr")
        0.0
    """
    away = _sweep(positions, _to_base(frame))
    return math.atan2(float(away[1]), float(away[0])) + 0.0


def kept_yaw(yaw_rad: float) -> float:
    """Return a heading as files have it: to 0.1 mrad, and never beyond half a turn, which settings refuse.

    Example:
        >>> kept_yaw(math.pi)
        3.1415
    """
    return max(-3.1415, min(3.1415, round(yaw_rad, 4)))


def check_forward(positions: ArrayLike, *, frame: str, yaw_rad: float) -> ForwardCheck:
    """Judge a second forward movement after calibration, while the operator watches the arm's picture.

    ``positions`` (n, 3), in metres, are places of the tracker during it, in its axes ``frame``.
    """
    try:
        away = turned(-yaw_rad) @ _sweep(positions, FRAMES[frame])
    except CalibrationError as error:
        return ForwardCheck(ok=False, off_rad=0.0, words=str(error))
    off = math.atan2(float(away[1]), float(away[0]))
    if abs(off) <= MOST_OFF_RAD:
        return ForwardCheck(ok=True, off_rad=off, words="forward is forward")
    degrees = math.degrees(off)
    if abs(off) > math.radians(135):
        words = "forward came out backward: the frame or the heading is wrong"
    else:
        words = f"forward came out {abs(degrees):.0f}° to the {'left' if off > 0 else 'right'}"
    return ForwardCheck(ok=False, off_rad=off, words=f"{words}; calibrate again")


def _to_base(frame: str) -> NDArray[np.float64]:
    if frame not in FRAMES:
        raise InvalidValueError(f"there is no frame {frame!r}", f"one of {', '.join(FRAMES)}")
    return FRAMES[frame]


def _sweep(positions: ArrayLike, to_base: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the displacement of a straight, level movement, base's axes without the heading."""
    places = np.asarray(positions, np.float64)
    if places.ndim != 2 or places.shape[1] != 3 or not np.isfinite(places).all():
        raise InvalidValueError(
            f"places have shape {places.shape} or are not finite; wanted is (n, 3), metres"
        )
    if len(places) < 2:
        raise CalibrationError("no movement was seen", "move the hand straight forward by 20 cm")
    places = (places - places[0]) @ to_base.T
    farthest = int(np.argmax(np.linalg.norm(places, axis=1)))
    away: NDArray[np.float64] = places[farthest]
    length = float(np.linalg.norm(away))
    if length < SHORTEST_M:
        raise CalibrationError(
            f"the hand moved {100 * length:.0f} cm, which is too little", "move it straight forward by 20 cm"
        )
    # How far the way strays from its chord, so that a tracker's noise does not count as way.
    chord = away / length
    along = places[: farthest + 1] @ chord
    stray = float(np.linalg.norm(places[: farthest + 1] - np.outer(along, chord), axis=1).max())
    if stray > (1 - LEAST_STRAIGHT) * length:
        raise CalibrationError(
            f"the way strayed by {100 * stray:.0f} cm from a straight line", "move the hand straight forward"
        )
    if abs(math.asin(float(chord[2]))) > STEEPEST_RAD:
        raise CalibrationError(
            f"the way rose by {math.degrees(math.asin(float(chord[2]))):.0f}°", "keep the hand level"
        )
    return away


class ForearmSweep:
    """Collects poses until the forearm has moved and come to rest; restarts if the forearm is lost.

    ``yaw_rad`` is the direction of forward, as far as it is known; ``places`` are in the tracker's axes
    ``frame``, metres. ``done``: it has gone 10 cm or more and then rested for half a second.

    Example:
        >>> sweep = ForearmSweep("openxr")
        >>> for k in range(100):
        ...     sweep.take(StampedPose(k * 10_000_000, (0, 0, -0.01 * min(k, 20)), (0, 0, 0, 1)))
        >>> sweep.done, sweep.gone_m.round(2).tolist()
        (True, [0.2, 0.0, 0.0])
    """

    def __init__(self, frame: str, *, yaw_rad: float = 0.0) -> None:
        self._to_base = turned(-yaw_rad) @ _to_base(frame)
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
