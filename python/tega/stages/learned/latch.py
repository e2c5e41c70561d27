"""Hold a closure level until blocks beyond it have added up to evidence of another: a steady effort keeps its level.

The smoothed closure would show a change late, and single blocks tremble. Each block's own closure, unsmoothed, is
therefore evidence, and a cumulative sum (Page's CUSUM) weighs it. The evidence required depends on the level's recent
course: the more the level has changed, the more is required, and more still for a change back, since effort that has
begun to rise or fall continues for a second or so. A rare change is thus accepted soon, and a busy level calms down.
"""

from __future__ import annotations

import math
from typing import Final

DRIFT_LEVELS: Final = 0.7
"""So far from the level a block's closure counts for neither side; half a level is its border."""
POWER: Final = 1.25
"""Exponent of the distance beyond the level, levels: above 1, a large change is accepted before a small one."""
AREA: Final = 0.13
"""Sum that is required, over time in seconds, if the level has been steady."""
BUSY, BUSY_S = 0.1, 3.0
"""So much more is asked for, for the square of the changes of late; a change is forgotten with that time constant."""
BACK, BACK_S = 6.0, 1.5
"""So many times more is asked for a change back, right after a change; that is forgotten with that time constant."""
AHEAD: Final = 0.5
"""The new level is the nearest to where effort goes: past the newest block by this share of its lead over the smoothed
closure."""


class Latch:
    """Give closures of single blocks a level.

    A block at distance a from the level, in levels, adds (a - drift)^power to the sum of its own way, or takes
    drift - a from it; the sums never fall below 0. The level changes where a sum, over time, reaches
    ``area (1 + busy n²) (1 + back exp(-t / back_s))``: n counts the last changes, each as exp(-its age / busy_s), and
    the last factor is there only for a change the other way than the last one, t ago. After long steadiness two levels
    or more are so changed at the first block, and one level after 0.6 s, if no block is back before.
    Effort that jumps within one block is taken for effort that still rises: its level is one too high for some two
    seconds. Muscles take three blocks.
    """

    def __init__(self, block_s: float) -> None:
        self._block_s = block_s
        self._up = self._down = 0.0
        self._since_s = math.inf
        self._n_of_late = 0.0
        self._last_direction = 0
        self.level = 0

    def take(self, closure: float, smoothed: float) -> None:
        """Take the next block's closure and the smoothed one, 0 to 1; ``level`` is then its level, 1 to 5."""
        goes_to = min(1.0, max(0.0, closure + AHEAD * (closure - smoothed)))
        nearest = min(5, int(1.5 + 4.0 * goes_to))
        if self.level == 0:
            self.level = nearest
        self._since_s += self._block_s
        self._n_of_late *= math.exp(-self._block_s / BUSY_S)
        away = 1.0 + 4.0 * closure - self.level
        self._up = self._added(self._up, away)
        self._down = self._added(self._down, -away)
        route = 1 if self._up >= self._down else -1
        requested = AREA * (1.0 + BUSY * self._n_of_late**2)
        if route == -self._last_direction:
            requested *= 1.0 + BACK * math.exp(-self._since_s / BACK_S)
        if max(self._up, self._down) >= requested and (nearest - self.level) * route > 0:
            self.level, self._last_direction = nearest, route
            self._up = self._down = self._since_s = 0.0
            self._n_of_late += 1.0

    def _added(self, sum_so_far: float, away: float) -> float:
        beyond = away - DRIFT_LEVELS
        counts = beyond**POWER if beyond > 0 else beyond
        return max(0.0, sum_so_far + counts * self._block_s)
