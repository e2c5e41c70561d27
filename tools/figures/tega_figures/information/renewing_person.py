"""Simulate a person by the second version of the rules, who follows of the vest only what has shown to be true.

The first version is the wheel's: :class:`tega.sim.operator.Operator`. Here a panel of the vest is heeded once it has
shown that it follows the closure (:mod:`.panels`), and the grip is corrected from where it is believed to be
(:mod:`.renewing`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar, Final

from tega.haptics import MotorLevels
from tega.sim.operator import Operator
from tega.sim.operator.acting import PANELS, TICK_S, VEST_READ_S, TrialOfPerson
from tega.sim.operator.belief import Closure, Panel
from tega.sim.operator.grip import GripDecisions
from tega.sim.operator.person import stream
from tega.sim.operator.vest_sense import LOOK_S
from tega_figures.information.panels import ConfirmedClosure
from tega_figures.information.renewing import RenewingGrip

# How long after a command has been followed the closure aimed at is a fair guess of the real one.
_FRESH_S: Final = 1.0
# Levels gone through in practice, and how long each is held, seconds.
_PRACTISED: Final = (2, 3, 4, 5, 4, 3, 2, 3, 4, 5)
_PRACTICE_S: Final = 1.5


class RenewingOperator(Operator):
    """A person at the task who trusts the vest as far as it has been found true."""

    decisions: ClassVar[type[GripDecisions]] = RenewingGrip

    def practise(self, name: str, shown: Callable[[float, float], MotorLevels | None]) -> None:
        """Close and open the hand on an object level by level, watching it and feeling the vest, before it is lifted.

        Args:
            name: Of the object.
            shown: What the vest is told, by the time in seconds and the closure in levels.
        """
        closure = self._recall(name, 0.0).closure
        if not self._feels or not isinstance(closure, ConfirmedClosure):
            return
        noise, reaction, link = (
            stream(self._seed, "operator", name, "practice", what) for what in ("vest", "touch", "link")
        )
        self._skin.begin(rest_s=0.0, noise=noise, reaction=reaction, link=link)
        looks_per_level = round(_PRACTICE_S / LOOK_S)
        for n in range(len(_PRACTISED) * looks_per_level):
            level = _PRACTISED[n // looks_per_level]
            for tick in range(5):
                t_s = n * LOOK_S + tick * TICK_S
                self._skin.feel(t_s, TICK_S, shown(t_s, float(level)))
            self._skin.look(t_s, LOOK_S)
            if (n + 1) % looks_per_level == 0:
                # The pose is in plain sight for several looks.
                closure.set(float(level), self.person.vision.pose_sd**2 / 4)
                for panel in PANELS:
                    if (felt := self._skin.mean_log(panel, t_s - VEST_READ_S)) is not None:
                        closure.feel(panel, *felt)

    def _heeds(self, closure: Closure, panel: Panel) -> bool:
        return isinstance(closure, ConfirmedClosure) and closure.trust(panel) > 0.5

    def _read_vest(self, t_s: float, trial: TrialOfPerson) -> None:
        closure = trial.grip.closure
        if not isinstance(closure, ConfirmedClosure) or not trial.grip.settled(t_s, VEST_READ_S):
            return
        trial.next_vest_read_s = t_s + VEST_READ_S
        fresh = not trial.grip.settled(t_s, VEST_READ_S + _FRESH_S)
        for panel in PANELS:
            if (felt := self._skin.mean_log(panel, t_s - VEST_READ_S)) is not None:
                closure.feel(panel, *felt, fresh=fresh)

    def _closure(self) -> Closure:
        return ConfirmedClosure(self.person.grip, self.person.vest.threshold)
