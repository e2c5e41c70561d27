"""Move the simulated forearm smoothly between places, and find the place for a phase."""

from __future__ import annotations

from typing import Final

AWAY_M: Final = 0.1
"""Distance of the second marked place from the first, back from the palm, metres; a task of one place has none."""

FARTHEST_M: Final = 0.2
"""How far back the hand can be led, metres."""


class SimulatedForearm:
    """Moves the hand as a whole from place to place, with minimum jerk.

    ``start_m`` is height over the grasp pose and distance back from it.
    """

    def __init__(self, start_m: tuple[float, float]) -> None:
        self._from = self._to = start_m
        self._start_s, self._duration_s = 0.0, 0.0
        self.at_m = start_m

    def move(self, to_m: tuple[float, float], t_s: float, duration_s: float) -> None:
        """Set out from where the hand is now; it arrives ``duration_s`` later."""
        self._from, self._to = self.at_m, to_m
        self._start_s, self._duration_s = t_s, duration_s

    def step(self, t_s: float) -> tuple[float, float]:
        """Return the place at ``t_s``."""
        share = 1.0 if self._duration_s <= 0 else min(max((t_s - self._start_s) / self._duration_s, 0.0), 1.0)
        eased = share**3 * (10 - 15 * share + 6 * share * share)
        self.at_m = (
            self._from[0] + (self._to[0] - self._from[0]) * eased,
            self._from[1] + (self._to[1] - self._from[1]) * eased,
        )
        return self.at_m

    def still(self, t_s: float, settle_s: float) -> bool:
        """Whether the last movement ended at least ``settle_s`` ago."""
        return t_s >= self._start_s + self._duration_s + settle_s - 1e-9
