"""Compare the evidence that a live stream carries about itself with the assumptions of its driver: one rule for all.

=============  ==========================================================================================
evidence       what is compared
=============  ==========================================================================================
``counter``    the device's own number of each packet, with one more than the packet before
``banner``     the device's description of itself, with the device that the settings name
``stamp``      the sender's time of each item, with the time at which the item arrived
``rate``       the measured rate, with the stated rate
``values``     the numbers or pictures themselves, with the range, the columns and the size that were agreed
=============  ==========================================================================================

Where the samples cannot be used, the driver raises :class:`StreamContradictionError`: opening is refused, and a running
source is lost. Where they can, it reports a :class:`Contradiction` among its ``faults``, which is an alert. Each driver
lists in its ``compared`` the evidence that its stream carries.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Final, Literal, NamedTuple, NoReturn, get_args

from tega.errors import StreamContradictionError

Evidence = Literal["counter", "banner", "stamp", "rate", "values"]
"""Evidence that a stream can carry about itself."""

EVIDENCE: Final[tuple[Evidence, ...]] = get_args(Evidence)
"""The names of all kinds of evidence."""

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


class Contradiction(NamedTuple):
    """Difference between a stream's ``evidence`` and its driver's assumption; ``found`` has the numbers."""

    evidence: Evidence
    found: str
    hint: str = ""

    def __str__(self) -> str:
        """Return one sentence that begins with the name of the evidence."""
        return f"{self.evidence}: {self.found}"


def refuse(driver: str, label: str, contradiction: Contradiction) -> NoReturn:
    """Refuse a stream with unusable samples: always raises ``StreamContradictionError``."""
    raise StreamContradictionError(f"{driver}: {label}: {contradiction}", contradiction.hint)


class Contradictions:
    """Contradictions of one open stream that leave its samples usable: those ``now``, and ``seen`` at any time."""

    def __init__(self) -> None:
        self._now: dict[str, Contradiction] = {}
        self.now: tuple[Contradiction, ...] = ()
        self.seen: tuple[Contradiction, ...] = ()

    def note(self, name: str, contradiction: Contradiction | None) -> None:
        """Note the result of one comparison."""
        if self._now.get(name) == contradiction:
            return
        if contradiction is None:
            del self._now[name]
        else:
            self._now[name] = contradiction
            # A number in the words may change; one comparison is kept once.
            others = [one for one in self.seen if one.evidence != contradiction.evidence]
            self.seen = (*others, contradiction)
        self.now = tuple(self._now.values())


def is_other_clock(age_s: float, *, ahead_s: float = AHEAD_S, away_s: float = AWAY_S) -> bool:
    """Return whether a stamp of this age (arrival less stamp) cannot be of this machine's clock.

    A stamp of this clock is at most ``ahead_s`` later than its arrival, and at most ``away_s`` earlier.
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
        """Return whether the newest item's stamp can be used; both times are on the monotonic clock."""
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
    where = "before the items arrive" if age_s > 0 else "after the items arrive"
    size_s = abs(age_s)
    amount = f"{size_s:.3g} s" if size_s < 600 else f"{size_s / 86_400:.3g} days"
    return f"the stamps lie {amount} {where}: they are of another clock"
