"""Decide by the second version of the person's rules, which corrects the grip from where it is believed to be.

What differs from :class:`tega_sim.operator.grip.GripDecisions`, for who wears a vest and who does not alike:

- A command is either a new movement to the middle of a level, with the error of a whole movement, or a correction: it
  moves from the believed closure by the difference, with an error in proportion to that (signal-dependent noise;
  Harris and Wolpert 1998, doi 10.1038/29528). The more certain of the two is taken. A person without feedback
  believes in the middle of the level and has almost nothing to correct; force feedback lets people correct drift and
  dispersion (Dosen 2015, doi 10.1186/s12984-015-0047-z). The first version could only start a new movement, to a
  neighbouring level.
- The level may stay as it is and be restored. The first version answered every weakening by the next level, although
  muscles slacken in every hold.
- A slip seen is answered by restoring the level where it is believed to be lost, and by the next one otherwise;
  deformation likewise, downwards.
- A quiet second at a closure that is believed to be lower than the last one that sufficed is evidence again.
"""

from __future__ import annotations

import math
from typing import Any

from tega_sim.operator.belief import cost
from tega_sim.operator.grip import HELD, LOOSEST, Decision, GripDecisions
from tega_sim.operator.vision import Eyes, Kind, SeenEvent


class RenewingGrip(GripDecisions):
    """One trial's course of decisions by the second version of the rules."""

    _suffices = 9.0

    def _learn(self, t_s: float, events: list[SeenEvent]) -> None:
        if self._need_reported and self.closure.x < self._suffices - self._grip.belief_floor_sd:
            self._need_reported = False
        reported = self._need_reported
        super()._learn(t_s, events)
        if self._need_reported and not reported:
            self._suffices = self.closure.x

    def _adjust(self, kinds: set[Kind]) -> tuple[int | None, str]:
        # Less than this cannot be told from the middle of the level.
        lost = self.level - self.closure.x
        if self.phase in HELD and "slip" in kinds:
            self._barred = -1
            return self._best((0, 1) if lost > self._grip.closure_sd else (1,)), "slip"
        if "deformation" in kinds:
            self._barred = 1
            return self._best((-1, 0) if -lost > self._grip.closure_sd else (-1,)), "deformation"
        here = cost(self.belief, self.closure.x, self.closure.var)
        if self.phase in HELD and "weaker" in kinds and self._expected(self.level) < here:
            return self.level, "weaker"
        level = self._best(tuple(step for step in (-1, 0, 1) if step == 0 or step != self._barred))
        if here - self._expected(level) > self._grip.gain_to_act:
            return level, "cost"
        return None, ""

    def _best(self, steps: tuple[int, ...]) -> int:
        lowest = max(self._least, LOOSEST)
        levels = [self.level + step for step in steps if lowest <= self.level + step <= 5]
        return min(levels or [self.level], key=self._expected)

    def _expected(self, level: int) -> float:
        return cost(self.belief, level, min(self._renewed(level), self._corrected(level)))

    def _renewed(self, level: int) -> float:
        return (self._aim_sd * level) ** 2 + self._grip.closure_sd**2

    def _corrected(self, level: int) -> float:
        return self.closure.var + (self._aim_sd * (level - self.closure.x)) ** 2

    def _command(self, t_s: float, level: int, why: str) -> Decision:
        if why in {"close", "open"} or self._renewed(level) <= self._corrected(level):
            decision = super()._command(t_s, level, why)
            self._set_closure(float(level))
            self._suffices = 9.0
            return decision
        change, var = level - self.closure.x, self._corrected(level)
        decision = super()._command(t_s, level, why)._replace(change=change)
        self.closure.set(float(level), var)
        # The sense of effort is off by the same share as before: nothing new is learned from it.
        self._judged = True
        self._suffices = 9.0
        self.commands[-1] = decision
        return decision


_CAUSED_BY_TIGHTENING = {"deformation": True, "slip": False}


class JudgingEyes(Eyes):
    """One person's sight during a trial; the person knows the limit of the object.

    ``bears_m`` is the narrowing from which the object counts as harmed; 0 if unknown.
    """

    def __init__(self, *args: Any, bears_m: float, **sight: Any) -> None:
        super().__init__(*args, **sight)
        self._bears = bears_m / self._width_m
        self._judged = 0.0

    def _dented(self, share: float, drawn: float) -> bool:
        step = math.exp(self._p.deform_log_sd)
        if share * step < self._judged:
            self._judged = share
        if share <= max(self._judged * step, 0.0):
            return False
        self._judged = share
        return drawn < self._seen(share, max(self._p.deform_theta * self._blurred, self._bears))


class SettledGrip(RenewingGrip):
    """One trial's course of decisions by the third version of the rules."""

    _tightened = False

    def _precedes(self, event: SeenEvent) -> bool:
        caused = _CAUSED_BY_TIGHTENING.get(event.kind)
        own = event.began_s >= self._commanded_s and caused is self._tightened
        return super()._precedes(event) and not own

    def _answers(self, event: SeenEvent) -> bool:
        return not self._precedes(event)

    def _command(self, t_s: float, level: int, why: str) -> Decision:
        before = self.closure.x
        decision = super()._command(t_s, level, why)
        self._tightened = self.closure.x > before
        return decision
