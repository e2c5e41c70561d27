"""Trials whose times are not spoilt by a machine that stood still."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import TypeVar

from tega.errors import TegaError
from tega.every import every

__all__ = ["in_peace"]

# Held up for longer than this, a time that was measured is the machine's, not that of what is tried.
_STOOD_STILL_S = 0.5
_ATTEMPTS = 4
_LOOK_S = 0.02

Found = TypeVar("Found")


def in_peace(trial: Callable[[], Found]) -> Found:
    """Run a trial; again if this machine stood still meanwhile, and the last time whatever it did."""
    for left in reversed(range(_ATTEMPTS)):
        looks_s = [time.monotonic()]

        def look(looks_s: list[float] = looks_s) -> None:
            looks_s.append(time.monotonic())

        try:
            with every(look, every_s=_LOOK_S, name="tega-peace"):
                found = trial()
        except TegaError:
            if _longest_s(looks_s) < _STOOD_STILL_S or not left:
                raise
            continue
        if _longest_s(looks_s) < _STOOD_STILL_S:
            break
    return found


def _longest_s(looks_s: Sequence[float]) -> float:
    """Return the longest time between two looks at the clock."""
    return max((after - before for before, after in pairwise(looks_s)), default=0.0)
