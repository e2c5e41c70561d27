"""Slips, counted as an observer would who had the truth."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final, NamedTuple

from tega.sim.seams import Truth

__all__ = ["Slip", "slips"]

_FAST_M_S: Final = 0.005
_FAST_FOR_S: Final = 0.03
_FAR_M: Final = 0.001
_FAR_WITHIN_S: Final = 0.2
_STILL_M_S: Final = 0.002
_STILL_FOR_S: Final = 0.1
_MERGE_S: Final = 0.2


class Slip(NamedTuple):
    """One slip.

    Attributes:
        start_s: When the object began to move.
        end_s: When it stood again.
        distance_m: How far it slid.
        speed_m_s: How fast at most.
    """

    start_s: float
    end_s: float
    distance_m: float
    speed_m_s: float


def slips(truths: Iterable[Truth]) -> list[Slip]:
    """Return the slips after lift-off in a course of truths.

    A slip has begun when the object was faster than 5 mm/s for 30 ms and went 1 mm within 200 ms; it has ended
    when it was slower than 2 mm/s for 100 ms, or no longer held up. Slips less than 200 ms apart are one.

    Args:
        truths: In order of time, 10 ms apart at most.
    """
    found: list[Slip] = []
    start: Truth | None = None
    last_fast: Truth | None = None
    fastest, fast_run_s, longest_run_s, reached_m = 0.0, 0.0, 0.0, 0.0
    before: Truth | None = None

    def close(end: Truth) -> None:
        nonlocal start
        if start is not None and longest_run_s >= _FAST_FOR_S and reached_m >= _FAR_M:
            one = Slip(start.t_s, end.t_s, end.slip_m - start.slip_m, fastest)
            if found and one.start_s - found[-1].end_s < _MERGE_S:
                first = found.pop()
                one = Slip(
                    first.start_s,
                    one.end_s,
                    first.distance_m + one.distance_m,
                    max(first.speed_m_s, one.speed_m_s),
                )
            found.append(one)
        start = None

    for truth in truths:
        step_s = truth.t_s - before.t_s if before is not None else 0.0
        if not truth.lift_off:
            if before is not None:
                close(before)
            before = None
            continue
        fast = truth.slip_m_s > _FAST_M_S
        if fast and start is None:
            start, fastest, longest_run_s, reached_m, fast_run_s = before or truth, 0.0, 0.0, 0.0, 0.0
        if start is not None:
            fast_run_s = fast_run_s + step_s if fast else 0.0
            longest_run_s = max(longest_run_s, fast_run_s)
            fastest = max(fastest, truth.slip_m_s)
            if truth.t_s - start.t_s <= _FAR_WITHIN_S or fast:
                reached_m = max(reached_m, truth.slip_m - start.slip_m)
            if truth.slip_m_s > _STILL_M_S:
                last_fast = truth
            elif last_fast is not None and truth.t_s - last_fast.t_s >= _STILL_FOR_S:
                close(last_fast)
        before = truth
    if before is not None:
        close(before)
    return found
