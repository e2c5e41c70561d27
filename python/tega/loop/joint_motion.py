"""Find when the joints of a hand begin to move after a new closure, in the positions that the hand reports."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

_REST_TICKS: Final = 100
"""Looks in which a closure is held and the joints stand before a motion counts: 0.3 s at the hand's rate."""
_NEW_LEVEL: Final = 0.1
"""By how much a closure differs that is a new one, levels: up to 0.04 rad between the built-in poses."""
_LEAST_RAD: Final = 0.002
"""Motion below this is not counted, however quiet the hand is: some 20 steps of an Allegro Hand's encoders."""
_TIMES_NOISE: Final = 3.0
"""A joint has moved once it is so many times as far from rest as it was at most in a hundred looks at rest."""
_RESTLESS_RAD: Final = 0.003
"""Joints that are further than this from their mean within a hundred looks are on their way."""
_GIVE_UP_NS: Final = 1_000_000_000


class _Rest(NamedTuple):
    mean_rad: NDArray[np.float64]
    threshold_rad: NDArray[np.float64]


class JointMotion:
    """Watches a hand at every tick: learns each joint's noise at rest, waits for motion after a new closure.

    A motion counts if the closure was held and the joints stood still for 0.3 s before, and if two differing
    reports show a joint beyond its threshold; its time is that of the first of these reports. Commands imposed by a
    guard, closures taken back before anything moved, and motion from outside do not count.

    ``angles_rad`` returns the joint angles as last reported, float64 (16,), rad; NaN before the first report.
    ``n_unmoved`` counts new closures after which no joint moved for a second; they are in no percentile.
    """

    def __init__(self, angles_rad: Callable[[], NDArray[np.float64]]) -> None:
        self._angles_rad = angles_rad
        self._seen: list[NDArray[np.float64]] = []
        self._held: float = 0.0
        self._rest: _Rest | None = None
        self._reported: tuple[int, ...] = ()
        self._first: tuple[int, NDArray[np.float64]] | None = None
        self._looked_at: tuple[_Rest | None, NDArray[np.float64] | None] = (None, None)
        self._moved = False
        self.n_unmoved = 0

    def check(
        self, now_ns: int, level: float | None, block: tuple[int, ...] | None
    ) -> tuple[int, ...] | None:
        """Check the hand for motion, after the newest level was commanded.

        ``level`` is what the muscles ask for, 1 to 5, ``None`` if another one is commanded; ``block`` has the stamps of
        the newest block of EMG. Returns these, the stamp of the command, and that of a joint's first motion.
        """
        angles = self._angles_rad()
        if level is None:
            self._begin(0.0)
            return None
        if self._reported:
            return self._wait(now_ns, level, angles)
        if abs(level - self._held) > _NEW_LEVEL:
            if self._rest is not None and block is not None and not self._beyond(self._rest, angles):
                self._reported = (*block, now_ns)
            else:
                self._begin(level)
            return None
        if self._rest is not None and self._beyond(self._rest, angles):
            self._begin(level)
        self._seen.append(angles)
        if len(self._seen) == _REST_TICKS:
            looks = np.array(self._seen)
            self._seen.clear()
            mean = looks.mean(axis=0)
            spread = np.abs(looks - mean).max(axis=0)
            stands = bool(spread.max() < _RESTLESS_RAD)  # not where one is no number
            self._rest = _Rest(mean, np.maximum(_TIMES_NOISE * spread, _LEAST_RAD)) if stands else None
        return None

    def _wait(self, now_ns: int, level: float, angles: NDArray[np.float64]) -> tuple[int, ...] | None:
        assert self._rest is not None
        if abs(level - self._held) <= _NEW_LEVEL:  # taken back
            self._begin(level)
        elif now_ns - self._reported[-1] > _GIVE_UP_NS:
            self.n_unmoved += 1
            self._begin(level)
        elif not self._beyond(self._rest, angles):
            self._first = None
        elif self._first is None:
            self._first = now_ns, angles
        elif not np.array_equal(angles, self._first[1]):
            stamps = (*self._reported, self._first[0])
            self._begin(level)
            return stamps
        return None

    def _begin(self, level: float) -> None:
        """Reset the rest position, and check whether the hand stands at a level."""
        self._held, self._rest, self._reported, self._first = level, None, (), None
        self._seen.clear()

    def _beyond(self, rest: _Rest, angles: NDArray[np.float64]) -> bool:
        """Whether a joint has moved; checked only if the hand has sent a new report."""
        if rest is not self._looked_at[0] or angles is not self._looked_at[1]:
            self._looked_at = rest, angles
            self._moved = bool((np.abs(angles - rest.mean_rad) > rest.threshold_rad).any())
        return self._moved
