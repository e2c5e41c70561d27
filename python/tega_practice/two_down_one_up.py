"""Adapt the difficulty of a question by a two-down one-up staircase (Levitt 1971, doi 10.1121/1.1912375).

Example:
    >>> stairs = TwoDownOneUp(start=0.4, least=0.01, most=0.5)
    >>> while not stairs.ended:
    ...     stairs.answer(right=stairs.difference > 0.1)
    >>> 0.08 < stairs.threshold < 0.12
    True
"""

from __future__ import annotations

import math
from typing import Final

from tega.errors import InvalidValueError

STEP: Final = 0.75
"""Factor of a step towards the harder."""

REVERSALS: Final = 8
"""Number of reversals after which the staircase ends; the first two only find the neighbourhood."""

LONGEST: Final = 50
"""And after so many questions, whatever is answered."""

_SETTLING = 2


class TwoDownOneUp:
    """Makes a difference smaller after two right answers and larger after a wrong one: it settles where 71 % are right.

    Attributes:
        difference: The next one to ask about.
        n_asked: Questions answered so far.

    Raises:
        InvalidValueError: The differences are not positive, or not in order.
    """

    def __init__(self, *, start: float, least: float, most: float) -> None:
        if not 0 < least <= start <= most:
            raise InvalidValueError(
                f"start = {start:g} is not within least = {least:g} (above 0) and most = {most:g}"
            )
        self._least, self._most = least, most
        self._turns: list[float] = []
        self._harder = True
        self._n_right = 0
        self.difference = start
        self.n_asked = 0

    @property
    def ended(self) -> bool:
        """Whether nothing more is to be asked."""
        return len(self._turns) >= REVERSALS or self.n_asked >= LONGEST

    @property
    def share(self) -> float:
        """Share of the search that is done, 0 to 1."""
        return max(len(self._turns) / REVERSALS, self.n_asked / LONGEST)

    @property
    def threshold(self) -> float | None:
        """Geometric mean of the differences at which it turned; ``None`` where it did not turn often enough."""
        turns = self._turns[_SETTLING:]
        return math.exp(sum(map(math.log, turns)) / len(turns)) if len(turns) >= 2 else None

    def answer(self, *, right: bool) -> None:
        """Take the answer to the question about ``difference``.

        Raises:
            InvalidValueError: It has ended.
        """
        if self.ended:
            raise InvalidValueError("the staircase has ended: there is no question to answer")
        self.n_asked += 1
        self._n_right = self._n_right + 1 if right else 0
        if right and self._n_right < 2:
            return
        self._n_right = 0
        if right != self._harder:
            self._turns.append(self.difference)
            self._harder = right
        wanted = self.difference * (STEP if right else 1 / STEP)
        self.difference = min(max(wanted, self._least), self._most)
