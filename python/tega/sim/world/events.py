"""Slips, counted as an observer would who had the truth."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import groupby
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from tega.sim.seams import Truth

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Slip", "slips"]

_FAST_M_S: Final = 0.005
_FAST_FOR_S: Final = 0.03
_FAR_M: Final = 0.001
_FAR_WITHIN_S: Final = 0.2
_STILL_M_S: Final = 0.002
_PAUSE_S: Final = 0.2


class Slip(NamedTuple):
    """One slip.

    Attributes:
        start_s: When the object began to move.
        end_s: When it stood again.
        distance_m: How far it slid.
        speed_m_s: How fast at most.
    """

    start_s: float
    end_s: float
    distance_m: float
    speed_m_s: float


def slips(truths: Iterable[Truth]) -> list[Slip]:
    """Return the slips after lift-off in a course of truths.

    A slip is a stretch of sliding (2 mm/s and faster, pauses under 200 ms included) in which the object was faster
    than 5 mm/s for at least 30 ms on end and went at least 1 mm within 200 ms. Creep and jerks too short to be seen
    are none.

    Args:
        truths: In order of time, 10 ms apart at most.
    """
    found: list[Slip] = []
    for in_the_air, group in groupby(truths, lambda truth: truth.lift_off):
        if in_the_air:
            rows = np.array([(truth.t_s, truth.slip_m, truth.slip_m_s) for truth in group])
            found += _slips(*rows.T)
    return found


def _slips(
    t_s: NDArray[np.float64], slip_m: NDArray[np.float64], speed_m_s: NDArray[np.float64]
) -> Iterator[Slip]:
    sliding = np.flatnonzero(speed_m_s > _STILL_M_S)
    if not len(sliding):
        return
    pauses = np.flatnonzero(np.diff(t_s[sliding]) >= _PAUSE_S) + 1
    for stretch in np.split(sliding, pauses):
        first, last = max(int(stretch[0]) - 1, 0), int(stretch[-1])
        span = slice(first, last + 1)
        t, x, v = t_s[span], slip_m[span], speed_m_s[span]
        before = np.searchsorted(t, t - _FAR_WITHIN_S)
        if (x - x[before]).max() >= _FAR_M and _longest_s(t, v > _FAST_M_S) >= _FAST_FOR_S:
            yield Slip(float(t[0]), float(t[-1]), float(x[-1] - x[0]), float(v.max()))


def _longest_s(t_s: NDArray[np.float64], is_fast: NDArray[np.bool_]) -> float:
    """Return how long the longest run of fast samples lasted, counted from the sample before it."""
    longest = begun = 0.0
    before = float(t_s[0])
    running = False
    for time, fast in zip(t_s.tolist(), is_fast.tolist(), strict=True):
        if fast and not running:
            begun = before
        running, before = fast, time
        if fast:
            longest = max(longest, time - begun)
    return longest
