"""Fill the held object by portions: the task ``fill``, in which a grip that sufficed for the lift may not do.

A grip that becomes too loose lets the object slide slowly at first, so that a person who notices can answer in time.
"""

from __future__ import annotations

from typing import Final

import numpy as np

HOLD_S: Final = 10.0
"""How long the object is held, seconds."""

PORTION_N: Final = 0.981
"""Weight of a portion, newtons: 0.1 kg. It has no inertia."""

_PORTIONS: Final = 15
_APART_S: Final = 0.6
# Beside the trial's seed, which the object's place is drawn from.
_STREAM: Final = 7919


class Filling:
    """Weight of what has been filled in during one hold.

    ``seed`` draws the first portion's time, within 0.6 s of the hold's beginning; the others follow every
    0.6 s.
    """

    def __init__(self, seed: int) -> None:
        first_s = float(np.random.default_rng([seed, _STREAM]).uniform(0.0, _APART_S))
        self._times_s = first_s + _APART_S * np.arange(_PORTIONS)
        self._since_s: float | None = None
        self._force_n = 0.0

    def force_n(self, t_s: float, *, holding: bool) -> float:
        """Return the weight at a time; it stays when the hold is over.

        The first call with ``holding`` is the hold's beginning.
        """
        if holding:
            self._since_s = t_s if self._since_s is None else self._since_s
            self._force_n = PORTION_N * int(np.count_nonzero(self._times_s <= t_s - self._since_s))
        return self._force_n
