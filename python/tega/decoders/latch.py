"""Hold a closure level until the closure has clearly left it, so that a steady effort gives a steady hand."""

from __future__ import annotations

from typing import Final

__all__ = ["Latch"]

MARGIN_LEVELS: Final = 0.4
"""How far beyond a level's border the closure has to be."""
DWELL_S: Final = 0.4
"""For how long, for a single step."""
JUMP_LEVELS: Final = 2.0
"""From so far on the level follows at once."""

_EDGE: Final = 1e-9


class Latch:
    """Give a closure its level, and keep the closure within that level's band.

    A level changes at once where the closure is two levels away or more, else once the closure has been 0.4 levels
    beyond the border, on the same side, for 0.4 s. Within the band of a level the closure moves freely, so that the
    nearest level of what is returned is always the level.

    Args:
        block_s: Time from one closure to the next, s.
    """

    def __init__(self, block_s: float) -> None:
        self._dwell = max(1, round(DWELL_S / block_s))
        self._run = 0
        self.level = 0

    def take(self, closure: float) -> float:
        """Return the closure to go to, 0 to 1; ``level`` is its level, 1 to 5."""
        place = 1.0 + 4.0 * closure
        nearest = min(5, int(place + 0.5))
        if self.level == 0:
            self.level = nearest
        away = place - self.level
        if abs(away) <= 0.5 + MARGIN_LEVELS:
            self._run = 0
        else:
            side = 1 if away > 0 else -1
            self._run = self._run + side if self._run * side > 0 else side
            if abs(away) >= JUMP_LEVELS or abs(self._run) >= self._dwell:
                self.level, self._run = nearest, 0
        low, high = (self.level - 1.5) / 4.0, (self.level - 0.5) / 4.0 - _EDGE
        return min(max(closure, low, 0.0), high, 1.0)
