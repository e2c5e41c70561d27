"""Run the course of a Fitts test: ask for one target after the other, and note each movement of the cursor."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from typing import Final, NamedTuple

from tega.errors import InvalidValueError
from tega_practice.fitts import CONDITIONS, Movement

DWELL_S: Final = 1.0
TIMEOUT_S: Final = 10.0
_ROUNDING: Final = 1e-9


class Target(NamedTuple):
    """Stretch of closure to be hit: its middle, 0 to 1, and its width from end to end."""

    centre: float
    width: float

    @property
    def low(self) -> float:
        """Lower end."""
        return self.centre - self.width / 2

    @property
    def high(self) -> float:
        """Upper end."""
        return self.centre + self.width / 2

    def holds(self, closure: float) -> bool:
        """Whether a closure is in it."""
        return self.low - _ROUNDING <= closure <= self.high + _ROUNDING


class FittsMovement(NamedTuple):
    """One movement as it is asked for.

    ``distance`` is from the last target's centre, closure. ``counts`` is whether it is scored; the first of a
    condition only leads to where that begins.
    """

    target: Target
    distance: float
    counts: bool


def fitts_plan(seed: int, *, movements: int = 6) -> list[FittsMovement]:
    """Return the movements of a test: each condition to and fro, the conditions in an order of chance."""
    if movements < 1:
        raise InvalidValueError(f"movements = {movements} of a condition has to be at least 1")
    return [
        FittsMovement(Target(high if n % 2 else low, width), high - low, counts=n > 0)
        for low, high, width in random.Random(seed).sample(list(CONDITIONS), len(CONDITIONS))
        for n in range(movements + 1)
    ]


class FittsCourse:
    """A test that goes on; ``movements`` are those that were made so far and count, oldest first."""

    def __init__(
        self, requested: Sequence[FittsMovement], *, dwell_s: float = DWELL_S, timeout_s: float = TIMEOUT_S
    ) -> None:
        if not 0 < dwell_s < timeout_s:
            raise InvalidValueError(
                f"dwell_s = {dwell_s:g} s has to be above 0 and under timeout_s = {timeout_s:g} s"
            )
        self._requested, self._dwell_s, self._timeout_s = list(requested), dwell_s, timeout_s
        self._n = 0
        self.movements: list[Movement] = []
        self._last: tuple[float, float] | None = None
        self._began = (0.0, 0.0)
        self._path = 0.0
        self._overshoots = 0
        # Time, closure and path at the entry into the target in which the cursor is.
        self._entry: tuple[float, float, float] | None = None

    @property
    def target(self) -> Target | None:
        """Target that is asked for now; ``None`` at the end."""
        return self._requested[self._n].target if self._n < len(self._requested) else None

    @property
    def inside(self) -> bool:
        """Whether the cursor is in it."""
        return self._entry is not None

    @property
    def left(self) -> int:
        """Movements still to be made."""
        return len(self._requested) - self._n

    def take(self, t_s: float, closure: float) -> None:
        """Take the cursor's next place; its time must be after the last one's, the closure 0 to 1."""
        if not 0 <= closure <= 1 or not math.isfinite(t_s):
            raise InvalidValueError(f"closure = {closure:g} at {t_s:g} s is not within 0 to 1")
        if self._last is not None and t_s <= self._last[0]:
            raise InvalidValueError(f"t_s = {t_s:g} s is not after {self._last[0]:g} s")
        if self.target is None:
            return
        if self._last is None:
            self._begin(t_s, closure)
        else:
            self._path += abs(closure - self._last[1])
        self._last = (t_s, closure)
        self._check(t_s, closure)

    def _begin(self, t_s: float, closure: float) -> None:
        self._began, self._path, self._overshoots = (t_s, closure), 0.0, 0
        self._entry = None

    def _check(self, t_s: float, closure: float) -> None:
        target = self._requested[self._n].target
        if target.holds(closure):
            if self._entry is None:
                self._entry = (t_s, closure, self._path)
            if t_s - self._entry[0] >= self._dwell_s - _ROUNDING:
                self._end(t_s, closure, self._entry, closure)
                return
        elif self._entry is not None:
            self._entry = None
            self._overshoots += 1
        if t_s - self._began[0] >= self._timeout_s - _ROUNDING:
            self._end(t_s, closure, (self._began[0] + self._timeout_s, closure, self._path), None)

    def _end(
        self, t_s: float, closure: float, entry: tuple[float, float, float], endpoint: float | None
    ) -> None:
        requested = self._requested[self._n]
        if requested.counts:
            self.movements.append(
                Movement(
                    distance=requested.distance,
                    width=requested.target.width,
                    centre=requested.target.centre,
                    start=self._began[1],
                    entry=entry[1],
                    endpoint=endpoint,
                    time_s=entry[0] - self._began[0],
                    path=entry[2],
                    overshoots=self._overshoots,
                    inside_at_start=requested.target.holds(self._began[1]),
                )
            )
        self._n += 1
        self._begin(t_s, closure)
