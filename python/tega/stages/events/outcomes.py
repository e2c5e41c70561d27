"""Decide whether an object was lifted, held and not dropped: one rule for simulation, camera, arm and study.

The paper (IV-B): "Grip success was defined at the task level if the object was lifted from the table and stably raised
to a height of 0.2m within a fixed time window (15s) for a trial. Trials were labeled unsuccessful if the object was
dropped or failed to reach the target height." It gives no duration for "stably" (reading A64: 1 s) and no start of the
window (reading A63: the start of the trial).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final, Literal

LIFT_M: Final = 0.2
"""Height that has to be reached, metres (the paper's)."""

STABLE_S: Final = 1.0
"""Duration at that height without a break, seconds (reading A64)."""

LIFT_WINDOW_S: Final = 15.0
"""Time from the start of the trial, seconds (the paper's, reading A63)."""

OFF_TABLE_M: Final = 0.005
"""Height from which an object has left the table, metres: more than a fingertip lifts it by rolling it."""

StableReading = Literal["begun", "complete"]
"""Which end of the stable second has to be within the window.

``begun``: the object is raised to the height in time, and then proves stable. ``complete``: the second ends in time.
"""

Verdict = Literal["open", "lifted", "too late"]

_EPS = 1e-9


class LiftRule:
    """Decides when an object is lifted, from its height.

    Args:
        window_s: End of the window, on the clock of the heights, seconds.
        stable: Reading of "stably raised within the window".

    Attributes:
        lift_off_s: Time at which the object left the table; ``None`` before.
        since_s: Since when it has been at the height; ``None`` while it is below.
        held_s: Begin and end of the first stable second, in the window or not; ``None`` before.

    Example:
        >>> rule = LiftRule()
        >>> for tenth in range(100):
        ...     rule.height(tenth / 10, 0.25 if tenth >= 70 else 0.0)
        >>> rule.lift_off_s, rule.held_s, rule.verdict(9.9)
        (7.0, (7.0, 8.0), 'lifted')
    """

    def __init__(self, *, window_s: float = LIFT_WINDOW_S, stable: StableReading = "begun") -> None:
        self._window_s, self._stable = window_s, stable
        self.lift_off_s: float | None = None
        self.since_s: float | None = None
        self.held_s: tuple[float, float] | None = None

    def height(self, t_s: float, height_m: float, *, off_table: bool | None = None) -> None:
        """Take in a height above the object's place on the table, metres; ``t_s`` never decreases.

        ``off_table`` says whether the object is off the table, if that is observed directly; ``None`` decides
        by :data:`OFF_TABLE_M`.
        """
        off_table = height_m >= OFF_TABLE_M if off_table is None else off_table
        if self.lift_off_s is None and off_table:
            self.lift_off_s = t_s
        if height_m < LIFT_M - _EPS:
            self.since_s = None
        elif self.since_s is None:
            self.since_s = t_s
        self.check(t_s)

    def check(self, t_s: float) -> None:
        """Advance the time; the height is unchanged."""
        if self.held_s is None and self.since_s is not None and t_s >= self.since_s + STABLE_S - _EPS:
            self.held_s = self.since_s, self.since_s + STABLE_S

    @property
    def lifted(self) -> bool:
        """Whether a stable second lies in the window, by the reading."""
        return self.held_s is not None and self._in_window(self.held_s[0])

    def verdict(self, t_s: float) -> Verdict:
        """Return the state of the trial at a time, seconds."""
        if self.lifted:
            return "lifted"
        begun = self.held_s is None and self.since_s is not None and self._in_window(self.since_s)
        latest_s = self._window_s - (STABLE_S if self._stable == "complete" else 0.0)
        return "open" if begun or (self.held_s is None and t_s <= latest_s + _EPS) else "too late"

    def _in_window(self, begin_s: float) -> bool:
        end_s = begin_s + (STABLE_S if self._stable == "complete" else 0.0)
        return end_s <= self._window_s + _EPS


def success(rule: LiftRule, kinds: Iterable[str]) -> bool:
    """Return whether a trial is a success: lifted in time, and no ``drop`` among the kinds of its events."""
    return rule.lifted and "drop" not in kinds
