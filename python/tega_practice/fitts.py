"""Compute throughput, path efficiency, overshoot and completion of a Fitts test on closure (ISO 9241-411).

A movement goes over a distance D to a target of width W, both in closure, 0 to 1. The target is hit by dwelling in it.
For the movements of one condition (a pair D, W), by ISO 9241-411, with the effective width
(as Soukoreff and MacKenzie 2004 have them)::

    ID  = log2(D / W + 1)                           bits, as asked for
    dx  = (end-point - centre) · direction          end-point: where the cursor is when the dwell is over
    s   = sqrt(s_dx² + q² / 12)                     s_dx: standard deviation with n - 1; q: the cursor's own step
    We  = 4.133 s                                   holds 96 % of a Gaussian
    De  = mean |end-point - start|
    IDe = log2(De / We + 1)
    TP  = n IDe / Σ t                               bits/s, n hits in the time of all movements of the condition
    throughput = mean of TP over the conditions

t runs from the target's appearing, reaction included, to the entry after which the cursor stayed; the dwell is left
out. Where every movement hits, TP is the standard's IDe over the mean of t. Two rules are added, since a dwelling test
ends without an error but by time running out, and some decoders know five levels only:

- a movement that timed out brings no bits and costs its time; fewer than two hits, with unknown scatter, bring none;
- a cursor that moves in steps of q does not resolve end points closer than that: q² / 12 is the variance of a number
  rounded to q. So five levels, all hit exactly, carry a finite number of bits.

Path efficiency is the distance from start to entry over the length of the cursor's path to there, mean over the hits;
overshoots are the times that the cursor left the target again before it was hit, per movement; completion is the share
of hits (definitions of the last three as in doi 10.1186/s12984-021-00832-4, table 3).

Example:
    >>> round(index_of_difficulty(0.5, 0.1), 2)
    2.58
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import fmean, stdev
from typing import Final, NamedTuple

import msgspec

from tega.errors import InvalidValueError

CONDITIONS: Final[tuple[tuple[float, float, float], ...]] = (
    (0.25, 0.5, 0.2),
    (0.5, 0.75, 0.12),
    (0.25, 0.5, 0.08),
    (0.25, 0.75, 0.2),
    (0.25, 0.75, 0.12),
    (0.25, 0.75, 0.08),
)
"""Lower centre, upper centre and width: ID 1.17 to 2.86 bits. Every target holds one of the five levels and lies
within 0 to 1, because no overshoot is possible at an end of the range. Decoders of levels can hit all of them."""

_GAUSSIAN: Final = 4.133


class Movement(NamedTuple):
    """One movement of the cursor to a target.

    Attributes:
        distance: Between the centres asked for, closure.
        start: Closure when the target appeared.
        entry: Closure at the entry after which the cursor stayed; where it was not hit, the last closure.
        endpoint: Closure when the dwell was over; ``None`` where time ran out.
        time_s: From the target's appearing to that entry, or to the end of the time.
        path: Length of the cursor's path in that time, closure.
        overshoots: Times that the cursor left the target again.
        inside_at_start: Whether the cursor was in the target from the start: nothing to move, so it does not
            count.
    """

    distance: float
    width: float
    centre: float
    start: float
    entry: float
    endpoint: float | None
    time_s: float
    path: float
    overshoots: int
    inside_at_start: bool


class FittsCondition(msgspec.Struct, frozen=True, kw_only=True):
    """Figures of one distance and width; the module's docstring has the equations.

    Attributes:
        effective_distance: De; ``None`` with fewer than two hits, as the next two.
        effective_width: We.
        effective_id_bits: IDe.
        movement_time_s: Mean time of the hits; ``None`` without any.
        movements: Movements that count.
    """

    distance: float
    width: float
    id_bits: float
    effective_distance: float | None = None
    effective_width: float | None = None
    effective_id_bits: float | None = None
    movement_time_s: float | None = None
    throughput_bits_s: float = 0.0
    completed: int
    movements: int


class FittsScore(msgspec.Struct, frozen=True, kw_only=True):
    """Figures of a whole test.

    Attributes:
        throughput_bits_s: Mean over the conditions.
        completion: Share of movements that hit, 0 to 1.
        path_efficiency: Mean over the hits, 0 to 1; ``None`` without any.
        overshoots: Per movement.
        movement_time_s: Mean over the hits; ``None`` without any.
        movements: Movements that count.
        conditions: Each distance and width, by rising ID.
    """

    throughput_bits_s: float
    completion: float
    path_efficiency: float | None
    overshoots: float
    movement_time_s: float | None
    movements: int
    conditions: tuple[FittsCondition, ...]


def index_of_difficulty(distance: float, width: float) -> float:
    """Return log2(distance / width + 1), bits; the width must be above 0, the distance not negative."""
    if not width > 0 or not distance >= 0:
        raise InvalidValueError(
            f"distance = {distance:g} has to be at least 0 and width = {width:g} closure has to be above 0"
        )
    return math.log2(distance / width + 1)


def fitts_score(movements: Sequence[Movement], *, cursor_step: float) -> FittsScore:
    """Score a test's movements; what began inside its target is left out.

    ``cursor_step`` is the closure between two neighbouring places of the cursor: 0.25 for five levels; for a
    closure the resolution of the display, 0.01. No movement that counts, or ends without scatter that have no
    step either, raise :class:`InvalidValueError`.
    """
    counted = [one for one in movements if not one.inside_at_start]
    if not counted:
        raise InvalidValueError(
            "the test has no movement that counts", "move the cursor: squeeze and let go, or calibrate again"
        )
    kinds = sorted(
        {(one.distance, one.width) for one in counted}, key=lambda kind: (index_of_difficulty(*kind), kind)
    )
    conditions = tuple(
        _condition([one for one in counted if (one.distance, one.width) == kind], cursor_step)
        for kind in kinds
    )
    hits = [one for one in counted if one.endpoint is not None]
    efficiencies = [abs(one.entry - one.start) / one.path if one.path > 0 else 1.0 for one in hits]
    return FittsScore(
        throughput_bits_s=fmean(one.throughput_bits_s for one in conditions),
        completion=len(hits) / len(counted),
        path_efficiency=fmean(efficiencies) if hits else None,
        overshoots=sum(one.overshoots for one in counted) / len(counted),
        movement_time_s=fmean(one.time_s for one in hits) if hits else None,
        movements=len(counted),
        conditions=conditions,
    )


def _condition(movements: list[Movement], cursor_step: float) -> FittsCondition:
    distance, width = movements[0].distance, movements[0].width
    hits = [(one, one.endpoint) for one in movements if one.endpoint is not None]
    figures = FittsCondition(
        distance=distance,
        width=width,
        id_bits=index_of_difficulty(distance, width),
        movement_time_s=fmean(one.time_s for one, _ in hits) if hits else None,
        completed=len(hits),
        movements=len(movements),
    )
    if len(hits) < 2:
        return figures
    along = [math.copysign(1.0, one.centre - one.start) * (end - one.centre) for one, end in hits]
    scatter = math.hypot(stdev(along), cursor_step / math.sqrt(12))
    if not scatter > 0:
        raise InvalidValueError(
            f"cursor_step = {cursor_step:g} closure: ends without scatter need a step above 0"
        )
    effective_width = _GAUSSIAN * scatter
    effective_distance = fmean(abs(end - one.start) for one, end in hits)
    effective_id = math.log2(effective_distance / effective_width + 1)
    spent_s = sum(one.time_s for one in movements)
    return msgspec.structs.replace(
        figures,
        effective_distance=effective_distance,
        effective_width=effective_width,
        effective_id_bits=effective_id,
        throughput_bits_s=len(hits) * effective_id / spent_s,
    )
