"""One stress case and how it is told."""

from __future__ import annotations

from typing import Literal, TypeAlias

import msgspec

__all__ = ["GROUPS", "Group", "StressCase", "short"]

Group: TypeAlias = Literal["contact", "sigmoid", "emg"]

GROUPS: dict[Group, str] = {
    "contact": "Contact metrics (Eq 1 to 6)",
    "sigmoid": "Vest intensity (Eq 7 to 9)",
    "emg": "EMG filter (Eq 10)",
}
"""Groups of cases in the order they are shown, with their titles."""


class StressCase(msgspec.Struct, frozen=True, kw_only=True):
    """What one case did and what came of it.

    Attributes:
        group: Which kernel it is about.
        name: Short name, unique within the group.
        done: What was done.
        happened: What happened, without anything that depends on the clock.
        error: How far off the worst result is, as ``error_of`` says.
        bound: Largest error that passes.
        error_of: What the error is a share or a number of.
        holds: Whether the other things that have to be true, told in ``happened``, are.
        timing: What it cost; informative, never judged.
    """

    group: Group
    name: str
    done: str
    happened: str
    error: float
    bound: float
    error_of: str
    holds: bool = True
    timing: str = ""

    @property
    def passed(self) -> bool:
        """Whether the error keeps its bound and everything else holds."""
        return self.holds and self.error <= self.bound


def short(value: float) -> str:
    """Write an error with one digit, which is all that is worth comparing.

    Example:
        >>> short(4.44e-16), short(0.0), short(3.0)
        ('4e-16', '0', '3')
    """
    if value == 0 or (1 <= value < 1000 and value == int(value)):
        return f"{value:.0f}"
    return f"{value:.0e}"
