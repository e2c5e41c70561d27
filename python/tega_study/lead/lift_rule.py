"""Decide when an object counts as lifted (readings A62 to A64)."""

from __future__ import annotations

from typing import Literal

LIFT_M = 0.2
"""Height that has to be reached, metres (the paper's)."""

STABLE_S = 1.0
"""How long it has to stay there without a break, seconds (reading A64)."""

OFF_TABLE_M = 0.005
"""Height from which an object has left the table, metres: more than a fingertip lifts it by rolling it."""

_EPS = 1e-9

Verdict = Literal["open", "lifted", "too late"]


class LiftRule:
    """Watches an object's height.

    It is lifted when it has been at the height for a second without a break, and that second *began* within the
    window. Begin and end are kept, so that the stricter reading (it also ends within it) needs no new data.

    Args:
        window_s: Time from the trial's start, seconds (reading A63).

    Attributes:
        lift_off_s: When it left the table; ``None`` before.
        since_s: Since when it has been at the height; ``None`` while it is below.
        held_s: Begin and end of the second that counts; ``None`` before.

    Example:
        >>> rule = LiftRule(window_s=15.0)
        >>> for tenth in range(100):
        ...     rule.height(tenth / 10, 0.25 if tenth >= 70 else 0.0)
        >>> rule.lift_off_s, rule.held_s, rule.verdict(9.9)
        (7.0, (7.0, 8.0), 'lifted')
    """

    def __init__(self, *, window_s: float) -> None:
        self._window_s = window_s
        self.lift_off_s: float | None = None
        self.since_s: float | None = None
        self.held_s: tuple[float, float] | None = None

    def height(self, t_s: float, height_m: float) -> None:
        """Take in a height.

        Args:
            t_s: Since the trial's start, seconds; never less than before.
            height_m: Over where the object stood, metres.
        """
        if self.lift_off_s is None and height_m >= OFF_TABLE_M:
            self.lift_off_s = t_s
        if height_m < LIFT_M - _EPS:
            self.since_s = None
        elif self.since_s is None:
            self.since_s = t_s
        self.look(t_s)

    def look(self, t_s: float) -> None:
        """Let time pass: the object is where it was."""
        if (
            self.held_s is None
            and self.since_s is not None
            and self.since_s <= self._window_s + _EPS
            and t_s >= self.since_s + STABLE_S - _EPS
        ):
            self.held_s = self.since_s, self.since_s + STABLE_S

    def verdict(self, t_s: float) -> Verdict:
        """Say how it stands at a time, seconds since the trial's start."""
        if self.held_s is not None:
            return "lifted"
        begun = self.since_s is not None and self.since_s <= self._window_s + _EPS
        return "open" if begun or t_s <= self._window_s + _EPS else "too late"
