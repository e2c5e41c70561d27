"""Score a trial from the truth by fixed rules: lifted or not, slips, deformations and drops.

The rules stand for an observer who sees the whole scene: a slip counts when it can be seen clearly, a deformation
when it goes beyond what holding that object takes. They were set before the first comparison of conditions.
"""

from __future__ import annotations

from typing import Literal

import msgspec

from tega.stages.events.outcomes import LIFT_WINDOW_S, LiftRule, success
from tega_sim.seams import WorldTruth

ON_MARK_M, UPRIGHT = 0.02, 0.9
"""Put down on its mark: this close to it, metres, and its axis this much upwards (a cosine). Proposals."""

# A slip: this fast for this long, and this far until it has rested. Speed and rest from the slip literature, the
# distance from what an observer a metre away calls clearly visible.
SLIP_M_S, SLIP_SUSTAINED_S = 0.005, 0.03
REST_M_S, REST_S = 0.002, 0.2
VISIBLE_SLIP_M = 0.003
# A deformation is over when the object is narrowed by less than this share of what counts as one.
EASED_SHARE = 0.8


class TrialEvent(msgspec.Struct, frozen=True):
    """Lift-off, slip, deformation or drop in a trial.

    Attributes:
        kind: ``lifted`` is stable at the height.
        t_s: When it began, from the trial's start; ``lifted``: when it was complete.
        size_m: Slip: way slid. Deformation: narrowing at its largest. Else 0.
    """

    kind: Literal["lift_off", "lifted", "slip", "deformation", "drop"]
    t_s: float
    size_m: float = 0.0


class TrialScorer:
    """Counts the events of a trial; receives the truth about a hundred times a second.

    ``rule`` is that of lift and hold. ``events`` are in the order of their beginning once the trial is
    closed. ``peak_force_n``, on one pad, and ``deformation_m``, the narrowing, are the largest so far;
    ``slid_m`` is the way slid since the object left the table.
    """

    def __init__(self, harm_m: float, *, window_s: float = LIFT_WINDOW_S) -> None:
        self._harm_m = harm_m
        self.rule = LiftRule(window_s=window_s)
        self.events: list[TrialEvent] = []
        self.peak_force_n = self.slid_m = self.deformation_m = 0.0
        self._fast_since_s: float | None = None
        self._fast_from_m = 0.0
        self._slip: tuple[float, float] | None = None
        self._rest_since_s: float | None = None
        self._squeeze: tuple[float, float] | None = None

    def take(self, t_s: float, truth: WorldTruth, *, placing: bool) -> None:
        """Take the current true state."""
        self.peak_force_n = max(self.peak_force_n, *truth.pad_force_n)
        self._deform(t_s, truth.deformation_m)
        if not truth.lift_off:
            return
        if self.time_of("lift_off") is None:
            self.events.append(TrialEvent("lift_off", t_s))
        if placing:
            self._end_slip()
            return
        if truth.dropped and self.time_of("drop") is None:
            self.events.append(TrialEvent("drop", t_s))
        self._rise(t_s, truth.object_height_m)
        self._slide(t_s, truth.slip_m, truth.slip_m_s)

    def close(self) -> None:
        """End the trial: events still under way count with their current values."""
        self._end_slip()
        self._end_squeeze()
        self.events.sort(key=lambda event: event.t_s)

    def time_of(self, kind: str) -> float | None:
        """Return when something first happened, or ``None``."""
        return next((event.t_s for event in self.events if event.kind == kind), None)

    @property
    def success(self) -> bool:
        """Whether the object was lifted in time and not dropped."""
        return success(self.rule, (event.kind for event in self.events))

    def count(self, kind: str) -> int:
        """Return how often something happened."""
        return sum(event.kind == kind for event in self.events)

    def _rise(self, t_s: float, height_m: float) -> None:
        self.rule.height(t_s, height_m, off_table=True)
        if self.rule.lifted and self.time_of("lifted") is None:
            self.events.append(TrialEvent("lifted", t_s))

    def _slide(self, t_s: float, slip_m: float, slip_m_s: float) -> None:
        if slip_m_s >= SLIP_M_S:
            if self._fast_since_s is None:
                self._fast_since_s, self._fast_from_m = t_s, self.slid_m
            if self._slip is None and t_s - self._fast_since_s >= SLIP_SUSTAINED_S:
                self._slip = (self._fast_since_s, self._fast_from_m)
        else:
            self._fast_since_s = None
        self.slid_m = max(self.slid_m, slip_m)
        if slip_m_s >= REST_M_S:
            self._rest_since_s = None
        elif self._rest_since_s is None:
            self._rest_since_s = t_s
        elif t_s - self._rest_since_s >= REST_S:
            self._end_slip()

    def _end_slip(self) -> None:
        if self._slip is not None:
            since_s, from_m = self._slip
            if self.slid_m - from_m >= VISIBLE_SLIP_M:
                self.events.append(TrialEvent("slip", since_s, self.slid_m - from_m))
        self._slip = None

    def _deform(self, t_s: float, deformation_m: float) -> None:
        self.deformation_m = max(self.deformation_m, deformation_m)
        if deformation_m >= self._harm_m:
            since_s, most_m = self._squeeze or (t_s, 0.0)
            self._squeeze = (since_s, max(most_m, deformation_m))
        elif deformation_m < EASED_SHARE * self._harm_m:
            self._end_squeeze()

    def _end_squeeze(self) -> None:
        if self._squeeze is not None:
            self.events.append(TrialEvent("deformation", *self._squeeze))
        self._squeeze = None
