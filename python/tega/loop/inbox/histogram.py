"""Keep a latency histogram in fixed memory and compute its percentiles."""

from __future__ import annotations

import math
from typing import Final

LEAST_SAMPLES: Final = 100
"""Smallest number of samples with percentiles: with fewer the p99 would be the maximum."""


class Histogram:
    """Counts numbers in bins a fiftieth wide: percentiles are right within 2 %, the worst is exact."""

    _GROWTH = math.log(1.02)

    def __init__(self) -> None:
        self._bins: dict[int, int] = {}
        self.n = 0
        self.worst_ns = 0

    def add(self, ns: int) -> None:
        """Add one value; values below a microsecond count as one microsecond."""
        k = int(math.log(max(ns, 1000)) / self._GROWTH)
        self._bins[k] = self._bins.get(k, 0) + 1
        self.n += 1
        self.worst_ns = max(self.worst_ns, ns)

    def at(self, share: float) -> float:
        """Return a percentile: the number that so large a share of all stays at or below, in ns; NaN for none."""
        left = math.ceil(share * self.n)
        for k in sorted(self._bins):
            left -= self._bins[k]
            if left <= 0:
                return min(math.exp((k + 1) * self._GROWTH), float(self.worst_ns))
        return math.nan

    def summary_ms(self) -> dict[str, float | int]:
        """Return count and worst, milliseconds, and from :data:`LEAST_SAMPLES` on p50, p95 and p99."""
        shares = {"p50": 0.5, "p95": 0.95, "p99": 0.99} if self.n >= LEAST_SAMPLES else {}
        found = {name: round(self.at(share) / 1e6, 3) for name, share in shares.items()}
        return {"n": self.n, **found, "worst": round(self.worst_ns / 1e6, 3)}
