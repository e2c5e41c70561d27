"""Compare a sender's time of each item with the item's arrival, and leave stamps of another clock aside."""

from __future__ import annotations

import math
from collections import deque
from typing import Final

from tega.runtime.evidence import Contradiction

AHEAD_S: Final = 0.05
"""An item cannot arrive before it was taken; clocks that are compared over a network agree much better than this."""
AWAY_S: Final = 10.0
"""No live sender holds its items back for so long: older stamps are of another clock."""
LATE_S: Final = 0.25
"""Items that are always later than this steer nothing: the guard holds them for lost."""

# The earliest item of so long a time has the true delay.
_WINDOW_S: Final = 1.0
# Before that, so much shows enough to refuse a stream when it is opened.
_LEAST_S: Final = 0.5
# A clock that was wrong is believed again after so long without a contradiction.
_BACK_S: Final = 5.0
# Between two items no delay grows faster than time passes; more than this beyond it is a clock that was set.
_STEP_S: Final = 0.1

_HINT: Final = (
    "stamp with the sender's lsl_local_clock(), or leave the stamps out; until then arrival times are used"
)


def is_other_clock(age_s: float, *, ahead_s: float = AHEAD_S, away_s: float = AWAY_S) -> bool:
    """Return whether a stamp of this age (arrival less stamp) cannot be of this machine's clock.

    It is at most ``ahead_s`` later than its arrival, and an item still on its way is at most ``away_s`` old.
    """
    return not -ahead_s <= age_s <= away_s


class StampCheck:
    """Compares the stamps of one stream as they come, and says which can be used.

    Attributes:
        contradiction: Contradiction for which arrival times are used instead; ``None`` for none.
        delay_s: Delay of the earliest item of the last second; ``None`` before half a second was seen, or while arrival
            times are used.

    Example:
        >>> check = StampCheck()
        >>> check.believes(100.0, 100.02), check.believes(1.7e9, 100.04)
        (True, False)
    """

    def __init__(self) -> None:
        self._ages: deque[tuple[float, float]] = deque()
        self._last: tuple[float, float] | None = None
        self._wrong_until_s = -1.0
        self.contradiction: Contradiction | None = None

    def believes(self, stamp_s: float, arrival_s: float) -> bool:
        """Return whether the newest item's stamp, ``stamp_s`` on the clock of the arrivals, can be used.

        ``arrival_s`` is on the monotonic clock and never less than before.
        """
        age_s, last, self._last = arrival_s - stamp_s, self._last, (stamp_s, arrival_s)
        found = ""
        if math.isnan(age_s) or is_other_clock(age_s):
            found = _words(age_s)
        elif last is not None and last[0] - stamp_s > _STEP_S:
            found = f"the stamps went back by {last[0] - stamp_s:.3g} s: the sender's clock was set"
        if found:
            self._wrong_until_s = arrival_s + _BACK_S
            self.contradiction = Contradiction("stamp", found, _HINT)
        elif self.contradiction is not None and age_s > LATE_S:
            self._wrong_until_s = arrival_s + _BACK_S  # a clock that was set back stays so
        elif arrival_s > self._wrong_until_s:
            self.contradiction = None
        if self.contradiction is not None:
            self._ages.clear()
            return False
        self._ages.append((arrival_s, age_s))
        while arrival_s - self._ages[0][0] > _WINDOW_S:
            self._ages.popleft()
        return True

    @property
    def delay_s(self) -> float | None:
        """Smallest age of the last second, seconds; ``None`` before half a second was seen."""
        ages = self._ages
        if not ages or ages[-1][0] - ages[0][0] < _LEAST_S:
            return None
        return min(age_s for _, age_s in ages)


def _words(age_s: float) -> str:
    """Return the difference of the two clocks in words."""
    where = "before the items arrive" if age_s > 0 else "after the items arrive"
    size_s = abs(age_s)
    amount = f"{size_s:.3g} s" if size_s < 600 else f"{size_s / 86_400:.3g} days"
    return f"the stamps lie {amount} {where}: they are of another clock"
