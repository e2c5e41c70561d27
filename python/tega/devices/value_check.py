"""Compare the samples of a live stream with the converter's range, and its columns with muscles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tega.runtime.evidence import Contradiction, Contradictions

# A spoiled sample now and then is no wrong range.
_BEYOND_SHARE: Final = 0.01
_POLL_S: Final = 0.5
# No muscle rises evenly for so long.
_RISING_S: Final = 2.0
# A counter of few bits begins again now and then; a time stamp has jitter.
_WRAPS_SHARE: Final = 0.02
_JITTER_SHARE: Final = 0.5


class ValueCheck:
    """Compares the samples of one source with its settings, half a second at a time.

    Args:
        limits: Smallest and largest value of the converter, in the samples' unit; ``None`` where they are unknown.
        free_columns: Whether a column may be something else than a muscle, such as a counter or a time stamp.

    Example:
        >>> check, found = ValueCheck(200.0, ["ch1"], limits=(0.0, 1023.0), free_columns=False), Contradictions()
        >>> check.take(np.full((100, 1), 3000.0), found)
        >>> str(found.now[0])
        'values: ch1 reaches 3000, the converter is said to give 0 to 1023'
    """

    def __init__(
        self,
        rate_hz: float,
        names: Sequence[str],
        *,
        limits: tuple[float, float] | None,
        free_columns: bool,
    ) -> None:
        self._names, self._limits, self._free = tuple(names), limits, free_columns
        self._n_checked = max(2, round(_POLL_S * rate_hz))
        self._n_rising = max(16, round(_RISING_S * rate_hz))
        self._past = np.empty((0, len(self._names)))
        self._new: list[NDArray[np.float64]] = []
        self._n_new = 0

    def take(self, samples: NDArray[np.float64], found: Contradictions) -> None:
        """Compare the next samples, (n, channels), and note the results in ``found``."""
        if self._limits is None and not self._free:
            return
        self._new.append(samples)
        self._n_new += len(samples)
        if self._n_new < self._n_checked:
            return
        recent = np.concatenate(self._new)
        self._past = np.concatenate([self._past, recent])[-self._n_rising :]
        self._new, self._n_new = [], 0
        found.note("range", self._beyond(recent))
        if self._free:
            found.note("columns", self._counting())

    def _beyond(self, recent: NDArray[np.float64]) -> Contradiction | None:
        if self._limits is None:
            return None
        low, high = self._limits
        shares = ((recent < low) | (recent > high)).mean(axis=0)
        worst = int(shares.argmax())
        if shares[worst] <= _BEYOND_SHARE:
            return None
        values = recent[:, worst]
        value = float(values.max() if values.max() > high else values.min())
        return Contradiction(
            "values",
            f"{self._names[worst]} reaches {value:g}, the converter is said to give {low:g} to {high:g}",
            "set bits or limits to those of the board; a clipped signal is not seen otherwise",
        )

    def _counting(self) -> Contradiction | None:
        if len(self._past) < self._n_rising:
            return None
        steps = np.diff(self._past, axis=0)
        for name, rises in zip(self._names, steps.T, strict=True):
            usual = float(np.median(rises))
            even = np.abs(rises - usual) <= _JITTER_SHARE * abs(usual)
            if usual != 0 and float((~even).mean()) <= _WRAPS_SHARE:
                return Contradiction(
                    "values",
                    f"{name} changes by {usual:g} from each sample to the next: a counter or a time stamp, no muscle",
                    "choose other channels, or set leading to the number of fields before the samples",
                )
        return None
