"""Hold a closure level until the closure has left it for long or by far: a steady effort gives a steady level."""

from __future__ import annotations

import math
from typing import Final

MARGIN_LEVELS: Final = 0.25
"""How far beyond a level's border the closure has to be to count."""
AREA_LEVEL_S: Final = 0.18
"""By how much, summed over time, it has to be beyond that."""
LEAK_S: Final = 0.45
"""Time constant with which that sum is forgotten while the closure is back."""
CALM_S: Final = 1.0
"""For about so long after a change up to twice the sum is asked for."""


class Latch:
    """Give a closure its level.

    A cumulative sum: what the closure is beyond the level's border and a margin is added up over time, and the level
    changes to the nearest one when the sum reaches an area: three levels away at the first block, half a level beyond
    the border after 0.7 s.

    Args:
        block_s: Time from one closure to the next, s.
    """

    def __init__(self, block_s: float) -> None:
        self._block_s = block_s
        self._kept = math.exp(-block_s / LEAK_S)
        self._sum = 0.0
        self._since_s = math.inf
        self.level = 0

    def take(self, closure: float) -> None:
        """Take the next closure, 0 to 1; ``level`` is then its level, 1 to 5."""
        place = 1.0 + 4.0 * closure
        nearest = min(5, int(place + 0.5))
        if self.level == 0:
            self.level = nearest
        self._since_s += self._block_s
        away = place - self.level
        beyond = abs(away) - 0.5 - MARGIN_LEVELS
        if beyond <= 0:
            self._sum *= self._kept
        else:
            if self._sum * away < 0:
                self._sum = 0.0
            self._sum += math.copysign(beyond * self._block_s, away)
            if abs(self._sum) >= AREA_LEVEL_S * (1.0 + math.exp(-self._since_s / CALM_S)):
                self.level, self._sum, self._since_s = nearest, 0.0, 0.0
