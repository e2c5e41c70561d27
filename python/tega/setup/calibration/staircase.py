"""Find the lowest level a person feels by going up and down: a state machine that asks and is answered.

A vest's motor has 16 levels, of which 0 is off; finer numbers do not reach it. The same machine finds the smallest
noticeable increase, where the level is the increase.

Example:
    >>> ladder = Ladder(ceiling=9)
    >>> while (level := ladder.level) is not None:
    ...     ladder.answer(felt=level >= 4)
    >>> ladder.result()
    Limen(level=4, n_false=0, n_trials=11)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tega.errors import InvalidValueError
from tega.wire import vest_levels

TOP_LEVEL = 15

LEVEL_PERCENT: tuple[int, ...] = tuple(
    np.searchsorted(vest_levels(range(101)), range(TOP_LEVEL + 1)).tolist()
)
"""The lowest percentage that reaches the motor as each level."""

_SERIES = 2
# A series begins so far on the other side of where the one before it ended.
_OVERLAP = 2


def highest_level(percent: float) -> int:
    """Return the highest level that is not above a percentage."""
    return max(level for level, p in enumerate(LEVEL_PERCENT) if p <= percent)


class Limen(NamedTuple):
    """Lowest level that a person feels, ``None`` for none up to the ceiling, and the number of questions.

    ``n_false`` counts the questions without vibration that were answered as felt.
    """

    level: int | None
    n_false: int
    n_trials: int


class Ladder:
    """Asks level by level, up until it is felt, down until it is not, and up again.

    The first way up goes two levels at a time and only finds the neighbourhood. One question of the second
    way up is without vibration (level 0), which exposes people who always say yes. The search ends after a
    bounded number of questions whatever the answers, and never exceeds the ceiling, a level from 1 to 15.
    """

    def __init__(self, ceiling: int) -> None:
        if not 1 <= ceiling <= TOP_LEVEL:
            raise InvalidValueError(f"ceiling = {ceiling} is out of range: level 1 to {TOP_LEVEL}")
        self._ceiling = ceiling
        self._crossings: list[float] = []
        self._series = 0
        self._requested_nothing = True
        self._n_false = self._n_trials = 0
        self._unfelt = False
        self.level: int | None = min(2, ceiling)

    @property
    def share(self) -> float:
        """Share of the search that is done, 0 to 1."""
        return 1.0 if self.level is None else self._series / (_SERIES + 1)

    def answer(self, *, felt: bool) -> None:
        """Take the answer to the question about ``level``, while there is one."""
        level = self.level
        if level is None:
            raise InvalidValueError("the ladder has ended: there is no question to answer")
        self._n_trials += 1
        if level == 0 and self._going_up:
            self._n_false += felt
            self._requested_nothing = True
            self.level = self._waiting
        elif self._going_up:
            self._up(level, felt=felt)
        else:
            self._down(level, felt=felt)

    def result(self) -> Limen:
        """Return the lowest level that is felt; only once the search has ended."""
        if self.level is not None:
            raise InvalidValueError("the ladder has not ended")
        if self._unfelt or not self._crossings:
            return Limen(None, self._n_false, self._n_trials)
        middle = sum(self._crossings) / len(self._crossings)
        # Crossings lie half way between two levels; of those the upper one is felt.
        found = max(1, min(self._ceiling, -int(-middle // 1)))
        return Limen(found, self._n_false, self._n_trials)

    @property
    def _going_up(self) -> bool:
        return self._series % 2 == 0

    def _up(self, level: int, *, felt: bool) -> None:
        if felt:
            if self._series:
                self._crossings.append(level - 0.5)
            self._turn(level)
        elif level == self._ceiling:
            self._unfelt, self.level = True, None
        else:
            self._ask(min(self._ceiling, level + (1 if self._series else 2)))

    def _down(self, level: int, *, felt: bool) -> None:
        if not felt:
            self._crossings.append(level + 0.5)
            self._turn(level)
        elif level == 1:
            self._crossings.append(0.5)
            self._turn(0)
        else:
            self._ask(level - 1)

    def _turn(self, level: int) -> None:
        self._series += 1
        if self._series > _SERIES:
            self.level = None
        elif self._going_up:
            self._requested_nothing = False
            self._ask(max(1, level - _OVERLAP))
        else:
            self._ask(min(self._ceiling, level + _OVERLAP))

    def _ask(self, level: int) -> None:
        if not self._requested_nothing and self._going_up:
            # Before the first question of a way up that could be answered by habit.
            self._waiting, self.level = level, 0
            return
        self.level = level
