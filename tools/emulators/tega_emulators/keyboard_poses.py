"""Make forearm poses from the keys of a terminal: every key is a small step, taken at a steady speed."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tega.arm.pose import StampedPose
from tega.arm.rotation import IDENTITY, exp, multiply, unit

POSE_KEYS_HELP: Final = (
    "w, s: forward, back · a, d: left, right · r, f: up, down · i, k: lean back, forward · j, l: turn left, right · "
    "u, o: roll left, right · space: stop"
)
"""The keys, in one line."""

_STEP_M, _STEP_RAD = 0.01, 0.05
_SPEED_M_S, _TURN_RAD_S = 0.1, 0.4
# Where held keys pile up, at most so much of the way is left over when they are released.
_MOST_LEFT_S: Final = 0.2
_PLACES: Final = {"w": (0, 1), "s": (0, -1), "a": (1, 1), "d": (1, -1), "r": (2, 1), "f": (2, -1)}
_TURNS: Final = {"u": (0, -1), "o": (0, 1), "i": (1, -1), "k": (1, 1), "j": (2, 1), "l": (2, -1)}


class KeyboardPoses:
    """Turns keys into the pose of a forearm that is not there, in the base's axes.

    Args:
        keys: Returns the keys pressed since it was last called, such as :meth:`tega.runtime.keys.Keys.read`.

    Example:
        >>> keys = iter([["w"], []])
        >>> poses = KeyboardPoses(lambda: next(keys))
        >>> _ = poses.read(0)
        >>> poses.read(100_000_000)[0].position_m
        [0.01, 0.0, 0.0]
    """

    frame: Final = "base"

    def __init__(self, keys: Callable[[], Sequence[str]]) -> None:
        self._keys = keys
        self._place, self._turn = np.zeros(3), IDENTITY
        self._left_m, self._left_rad = np.zeros(3), np.zeros(3)
        self._last_ns: int | None = None

    def read(self, now_ns: int) -> Sequence[StampedPose]:
        """Return one pose, of now."""
        if self._last_ns is not None and now_ns <= self._last_ns:
            return ()
        dt_s = 0.0 if self._last_ns is None else min((now_ns - self._last_ns) / 1e9, 0.1)
        self._last_ns = now_ns
        for key in self._keys():
            if key == " ":
                self._left_m, self._left_rad = np.zeros(3), np.zeros(3)
            elif key in _PLACES:
                axis, sign = _PLACES[key]
                self._left_m[axis] += sign * _STEP_M
            elif key in _TURNS:
                axis, sign = _TURNS[key]
                self._left_rad[axis] += sign * _STEP_RAD
        self._left_m, route = _part(self._left_m, _SPEED_M_S, dt_s)
        self._left_rad, turn = _part(self._left_rad, _TURN_RAD_S, dt_s)
        self._place = self._place + route
        self._turn = unit(multiply(exp(turn), self._turn))
        return (StampedPose(now_ns, self._place.tolist(), self._turn.tolist()),)


def _part(
    left: NDArray[np.float64], speed: float, dt_s: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Split off what is taken of the way that is left, and shorten what piled up."""
    size = math.hypot(*left.tolist())
    if size == 0:
        return left, left
    route = left * min(1.0, speed * dt_s / size)
    rest = left - route
    size = math.hypot(*rest.tolist())
    return rest * min(1.0, speed * _MOST_LEFT_S / size) if size else rest, route
