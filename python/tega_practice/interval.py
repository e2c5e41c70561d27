"""Estimate a mean and its 95 % interval over people or conditions, and compare decoders pairwise, by Student's t."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from statistics import fmean, stdev
from typing import Literal

import msgspec

from tega.errors import InvalidValueError
from tega.runtime.scientific import scipy_stats


class Interval(msgspec.Struct, frozen=True, kw_only=True):
    """Mean over ``n`` units with its 95 % interval.

    The ends are ``None`` with one unit, which says nothing of how units differ.
    """

    mean: float
    low: float | None = None
    high: float | None = None
    n: int

    def __str__(self) -> str:
        """Return the mean and the ends, such as ``1.20 [1.05, 1.35]``."""
        ends = "" if self.low is None or self.high is None else f" [{self.low:.2f}, {self.high:.2f}]"
        return f"{self.mean:.2f}{ends}"

    @property
    def side(self) -> Literal[-1, 0, 1]:
        """Sign of the mean where the interval leaves 0 out; else 0."""
        if self.low is not None and self.low > 0:
            return 1
        return -1 if self.high is not None and self.high < 0 else 0


def mean_interval(values: Sequence[float]) -> Interval:
    """Return the mean of some values with its interval by t, n - 1 degrees of freedom.

    Raises:
        InvalidValueError: There is no value.
        MissingExtraError: SciPy is not installed.

    Example:
        >>> mean_interval([1.0, 2.0, 3.0]).mean
        2.0
    """
    if not values:
        raise InvalidValueError("an interval needs at least one value")
    if len(values) == 1:
        return Interval(mean=values[0], n=1)
    mean = fmean(values)
    reach = float(scipy_stats().t.ppf(0.975, len(values) - 1)) * stdev(values) / len(values) ** 0.5
    return Interval(mean=mean, low=mean - reach, high=mean + reach, n=len(values))


def with_first(values: Mapping[str, Mapping[Hashable, float]]) -> dict[str, tuple[Interval, Interval | None]]:
    """Return each name's mean over its units, and its difference from the first name over the units of both.

    ``values`` has the value of each unit, by name; names without units are left out. The difference is
    ``None`` for the first name, and without common units.
    """
    found = {}
    first = next(iter(values), "")
    for name, units in values.items():
        if units:
            both = (
                []
                if name == first
                else [units[one] - values[first][one] for one in units if one in values[first]]
            )
            found[name] = mean_interval(list(units.values())), mean_interval(both) if both else None
    return found
