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

import math
from collections.abc import Generator
from typing import NamedTuple

import numpy as np

from tega.wire import vest_levels

TOP_LEVEL = 15

LEVEL_PERCENT: tuple[int, ...] = tuple(
    np.searchsorted(vest_levels(range(101)), range(TOP_LEVEL + 1)).tolist()
)
"""The lowest percentage that reaches the motor as each level."""

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

    Attributes:
        level: Level of the question; ``None`` once the search has ended.
        share: Share of the search that is done, 0 to 1.
    """

    def __init__(self, ceiling: int) -> None:
        self.share = 0.0
        self._found: Limen | None = None
        self._questions = self._ask(ceiling)
        self.level: int | None = next(self._questions)

    def answer(self, *, felt: bool) -> None:
        """Take the answer to the question about ``level``, while there is one."""
        try:
            self.level = self._questions.send(felt)
        except StopIteration as end:
            self.level, self.share, self._found = None, 1.0, end.value

    def result(self) -> Limen:
        """Return the lowest level that is felt; only once the search has ended."""
        assert self._found is not None
        return self._found

    def _ask(self, ceiling: int) -> Generator[int, bool, Limen]:
        """Yield the level of each question and receive whether it was felt; crossings lie half way between levels."""
        level, n_trials = min(2, ceiling), 1
        while not (yield level):
            if level == ceiling:
                return Limen(None, 0, n_trials)
            level, n_trials = min(ceiling, level + 2), n_trials + 1
        self.share = 1 / 3
        level, n_trials = min(ceiling, level + _OVERLAP), n_trials + 1
        while felt := (yield level):
            if level == 1:
                break
            level, n_trials = level - 1, n_trials + 1
        end, crossing = (0, 0.5) if felt else (level, level + 0.5)
        self.share = 2 / 3
        # Nothing vibrates before the first question of a way up that could be answered by habit.
        n_false = int((yield 0))
        level, n_trials = max(1, end - _OVERLAP), n_trials + 2
        while not (yield level):
            if level == ceiling:
                return Limen(None, n_false, n_trials)
            level, n_trials = level + 1, n_trials + 1
        # Of the two levels around the middle of the crossings the upper one is felt.
        middle = (crossing + level - 0.5) / 2
        return Limen(max(1, min(ceiling, math.ceil(middle))), n_false, n_trials)
