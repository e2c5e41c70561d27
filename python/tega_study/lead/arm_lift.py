"""Measure lift and drop of a held object by the arm's height and the fingertips."""

from __future__ import annotations

from typing import Final, NamedTuple

from tega.stages.events.settings import SETTINGS

ARM: Final = "arm"
"""Source of events that were measured so."""

LOST_S: Final = 0.5
"""Time without any contact after which the object is no longer in the hand, seconds: light contacts flicker."""

IN_AIR_M: Final = 0.03
"""Height from which an object that leaves the hand is dropped and not put down, metres (as for a scene camera)."""


class LiftCheck(NamedTuple):
    """State of the object at one reading.

    ``height_m`` is above the place where it was grasped, 0 if nothing is held. ``dropped_s`` is when it left
    the hand in the air, at the reading that confirms it; else ``None``.
    """

    height_m: float
    dropped_s: float | None


class ArmLift:
    """Follows a held object. Its height is the arm's height less that at which it was grasped.

    The arm cannot detect whether the hand holds something. The fingertips do, and the joints if they are measured: a
    hand that lags behind its command presses on something.
    """

    def __init__(self) -> None:
        self._base_m: float | None = None
        self._held_s = 0.0

    def check(
        self,
        t_s: float,
        arm_m: float,
        *,
        touching: bool | None,
        level: float | None = None,
        closure: float | None = None,
    ) -> LiftCheck:
        """Take in one reading of hand and arm; ``t_s`` is never less than before.

        ``arm_m`` is the height of the arm's end. ``touching``: whether any fingertip is in contact, ``None``
        if none delivers frames now. ``level`` is the commanded closure level, ``None`` before the first;
        ``closure`` the measured one, ``None`` without a measured hand.
        """
        lag = 0.0 if level is None or closure is None or level <= 1 else level - closure
        unknown = touching is None and self._base_m is not None
        if touching or unknown or lag > SETTINGS.pressed_levels:
            self._held_s = t_s
            self._base_m = arm_m if self._base_m is None else min(self._base_m, arm_m)
        if self._base_m is None:
            return LiftCheck(0.0, None)
        height_m = arm_m - self._base_m
        if t_s - self._held_s < LOST_S:
            return LiftCheck(height_m, None)
        self._base_m = None
        return LiftCheck(0.0, self._held_s if height_m >= IN_AIR_M else None)
