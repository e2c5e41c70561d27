"""Practise before the trials, as the second version of the person's rules needs: feel the vest level by level.

The practice is the bench's own, not the one-dimensional plant's: what the vest shows at a closure hangs on object, hand
and reading, and a person who was taught the plant's map would be taught a wrong one. A script without error holds each
level on the object, standing on the table, through EMG, decoder, hand, pictures and vest; the person watches the hand
and feels what the condition's vest did. Nobody tires by it, and what was learned is as of one run through the levels.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from tega_sim.conditions import ARMS
from tega_sim.operator.acting import PRACTICE_S, PRACTISED_LEVELS, Operator
from tega_sim.operator.scripted import ScriptedOperator, Step
from tega_sim.rig import ACT_NS

if TYPE_CHECKING:
    from tega.haptics import MotorLevels
    from tega_sim.lab import Lab
    from tega_sim.plan import TrialPlan
    from tega_sim.rig import TrialSteering
    from tega_sim.seams import Act, Percept


_REACHED_S = 1.5
_END_S = _REACHED_S + PRACTICE_S * len(PRACTISED_LEVELS)
_COURSE = (
    Step(0.0, "reach", 1, (0.0, 0.0), 1.2),
    *(
        Step(_REACHED_S + n * PRACTICE_S, "grasp", level, (0.0, 0.0), 0.0)
        for n, level in enumerate(PRACTISED_LEVELS)
    ),
    Step(_END_S, "done", 1, (0.0, 0.0), 0.0),
)


class LevelScript(ScriptedOperator):
    """Goes through the levels of the practice and keeps what the vest did.

    Attributes:
        vest: What was worn at each look, a hundred times a second.
    """

    def __init__(self, *, full_effort: float) -> None:
        super().__init__(_COURSE, full_effort=full_effort)
        self.vest: list[MotorLevels | None] = []

    def act(self, percept: Percept) -> Act:
        """Keep what the vest does, and go on with the script."""
        self.vest.append(percept.vest)
        return super().act(percept)


def practise(lab: Lab, plan: TrialPlan, person: TrialSteering, number: int = 0) -> float:
    """Let a person of the second version of the rules practise with a trial's object and vest; others do not.

    Who wears no vest, or one that tells events by pulses, learns nothing from it, and the bench is not run.

    Args:
        lab: The person's lab.
        plan: The trial.
        person: Who.
        number: Of the lift that comes next.

    Returns:
        Time simulated, seconds.
    """
    from tega_sim.lift import Lift

    arm = ARMS[plan.condition]
    if plan.rules == 1 or not isinstance(person, Operator):
        return 0.0
    if arm.pulses or arm.sham == "off" or arm.skin == "none":
        person.practise(plan.object, lambda _t_s, _level: None)
        return 0.0
    script = LevelScript(full_effort=lab.calibrated.full_effort)
    run = Lift(lab, plan, script, number, lift_by_s=_END_S + 1.0)
    run.go(real_time=False, observer=None, stop=lambda: False, paused=lambda: False)
    first, last, look_s = round(_REACHED_S * 1e9) // ACT_NS, len(script.vest) - 1, ACT_NS / 1e9
    person.practise(plan.object, lambda t_s, _level: script.vest[min(first + round(t_s / look_s), last)])
    return run.end_s
