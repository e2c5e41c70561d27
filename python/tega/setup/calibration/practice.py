"""Score how well a person follows a curve of levels (force tracking; no force is measured)."""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.errors import InvalidValueError

_HOLD_S = 3.0
_RAMP_S_PER_LEVEL = 0.75
_LONGEST_DELAY_S = 1.0


class Curve:
    """Ramps and holds between the five levels, in an order of chance; begins and ends at rest.

    No level follows itself, and every five holds visit every level. ``duration_s`` must be at least 10.
    """

    def __init__(self, duration_s: float, *, seed: int) -> None:
        if duration_s < 10:
            raise InvalidValueError(f"duration {duration_s:g} s is too short: 10 s at least")
        chance = random.Random(seed)
        self.duration_s = duration_s
        times, levels = [0.0, _HOLD_S], [1.0, 1.0]
        order: list[int] = []
        while times[-1] < duration_s:
            if not order:
                order = chance.sample(range(1, 6), 5)
                if order[0] == levels[-1]:
                    order.append(order.pop(0))
            level = order.pop(0)
            ramp_s = _RAMP_S_PER_LEVEL * abs(level - levels[-1])
            times += [times[-1] + ramp_s, times[-1] + ramp_s + _HOLD_S]
            levels += [float(level)] * 2
        self._times, self._levels = np.array(times), np.array(levels)

    def at(self, t_s: float) -> float:
        """Return the level asked for, 1 to 5."""
        return float(np.interp(t_s, self._times, self._levels))


class Score(NamedTuple):
    """Score of a followed curve.

    ``in_target`` is the share of the time on the level asked for (the nearest one, during a ramp).
    ``delay_s`` is the shift at which the level fits the curve best, 0 to 1 s; ``None`` if it never changed.
    """

    in_target: float
    rms_error_levels: float
    delay_s: float | None


def score(t_s: Sequence[float], levels: Sequence[int], curve: Curve) -> Score:
    """Score levels against a curve; there must be a level, and a time for each."""
    if not levels or len(levels) != len(t_s):
        raise InvalidValueError(f"{len(levels)} levels at {len(t_s)} times cannot be scored")
    own = np.array(levels, np.float64)

    def wanted(shift_s: float) -> NDArray[np.float64]:
        return np.array([curve.at(t - shift_s) for t in t_s])

    error = own - wanted(0.0)
    shifts = np.arange(0.0, _LONGEST_DELAY_S + 1e-9, 0.05)
    errors = [float(((own - wanted(float(s))) ** 2).mean()) for s in shifts]
    return Score(
        in_target=float((np.abs(error) <= 0.5).mean()),
        rms_error_levels=float(np.sqrt((error**2).mean())),
        delay_s=float(shifts[int(np.argmin(errors))]) if np.ptp(own) else None,
    )
