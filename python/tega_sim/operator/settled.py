"""See and decide by the third version of the person's rules: harm is more than the give of any hold.

What differs from the second version, for who wears a vest and who does not alike:

- Narrowing is compared with the limit of the object, as people are shown before a study, or with the least visible
  narrowing if that is more. The versions before took each narrowing that they saw for harm.
- A dent is judged when it has grown by a just noticeable difference, not at each look: two looks at the same dent are
  not independent evidence (correlated noise of judgement; one person's criterion lasts from look to look).
- A command is answered once: percepts from before it took effect belong to the closure before. They cause no other
  command, unless the command itself has this effect: loosening causes a slide, tightening a dent. The versions before
  applied this in learning and not in acting; people withhold their answer until a correction under way has shown its
  effect (van de Kamp 2013, doi 10.1371/journal.pcbi.1002843).
- Each object that falls teaches that the grip was too loose, in each view (see :class:`tega_sim.operator.Operator`):
  one error is enough for people to change their grip at the next lift (Johansson and Westling 1988,
  doi 10.1007/BF00247523).

Panels of the vest are heeded as by the second version (:mod:`tega_sim.operator.panels`).
"""

from __future__ import annotations

import math
from typing import Any

from tega_sim.operator.grip import Decision
from tega_sim.operator.renewing import RenewingGrip
from tega_sim.operator.vision import Eyes, SeenEvent

_CAUSED_BY_TIGHTENING = {"deformation": True, "slip": False}


class JudgingEyes(Eyes):
    """One person's sight during a trial; the person knows the limit of the object.

    Args:
        bears_m: Narrowing from which the object counts as harmed, metres; 0 if unknown.
        sight: As of :class:`Eyes`.
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
