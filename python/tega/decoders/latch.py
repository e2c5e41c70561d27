"""Hold a closure level until blocks beyond it have added up to evidence of another: a steady effort keeps its level.

The smoothed closure would tell of a change late, and a block alone trembles. So each block's own closure, unsmoothed,
is evidence, and a cumulative sum (Page's CUSUM) weighs it.
"""

from __future__ import annotations

import math
from typing import Final

DRIFT_LEVELS: Final = 0.7
"""So far from the level a block's closure counts for neither side; half a level is its border."""
AREA_LEVEL_S: Final = 0.25
"""By how much, summed over time, it has to be beyond that."""
CALM_S: Final = 1.0
"""For about so long after a change up to twice the sum is asked for."""


class Latch:
    """Give closures of single blocks a level.

    What a block is beyond the drift is added up over time, each way for itself and never below 0. Where a sum reaches
    the area, the level goes to the one nearest to the newest block: four levels away at the first block, one level away
    after 0.9 s, if no block is back before.

    Args:
        block_s: Time from one closure to the next, s.
    """

    def __init__(self, block_s: float) -> None:
        self._block_s = block_s
        self._up = self._down = 0.0
        self._since_s = math.inf
        self.level = 0

    def take(self, closure: float) -> None:
        """Take the next block's closure, 0 to 1; ``level`` is then its level, 1 to 5."""
        place = 1.0 + 4.0 * closure
        nearest = min(5, int(place + 0.5))
        if self.level == 0:
            self.level = nearest
        self._since_s += self._block_s
        away = place - self.level
        self._up = max(0.0, self._up + (away - DRIFT_LEVELS) * self._block_s)
        self._down = max(0.0, self._down + (-away - DRIFT_LEVELS) * self._block_s)
        if max(self._up, self._down) >= AREA_LEVEL_S * (1.0 + math.exp(-self._since_s / CALM_S)):
            if nearest != self.level:
                self._since_s = 0.0
            self.level, self._up, self._down = nearest, 0.0, 0.0
