"""Measure how often a second things are counted, over the last second."""

from __future__ import annotations

from collections.abc import Mapping


class RateMeter:
    """Turns counts that rise into rates over the last full second, by name; empty before one is over."""

    def __init__(self) -> None:
        self.rates_hz: dict[str, float] = {}
        self._since_s, self._before = 0.0, dict[str, int]()

    def take(self, now_s: float, counts: Mapping[str, int]) -> None:
        """Take the counts of now; where one is lower than before, another run began, which counts from 0 again."""
        passed_s = now_s - self._since_s
        if self._before and all(n >= self._before.get(name, 0) for name, n in counts.items()):
            if passed_s < 1.0:
                return
            self.rates_hz = {name: (n - self._before.get(name, 0)) / passed_s for name, n in counts.items()}
        self._since_s, self._before = now_s, dict(counts)
