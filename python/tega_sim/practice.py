"""Practise before the trials, as the second version of the person's rules needs: feel the vest level by level.

The practice runs on the bench, not on the one-dimensional plant: the vest's frame at a closure depends on object,
hand and metric, and a person who was taught the plant's map would be taught a wrong one. A script without error holds
each level on the object, standing on the table, through EMG, decoder, hand, camera frames and vest; the person
watches the hand and feels the condition's vest. Practice causes no fatigue, and the person learns as from one run
through the levels.
"""

from __future__ import annotations

from tega.haptics import MotorLevels
from tega_sim.conditions import ARMS
from tega_sim.lab import Lab
from tega_sim.operator.acting import PRACTICE_S, PRACTISED_LEVELS, Operator
from tega_sim.operator.scripted import ScriptedOperator, Step
from tega_sim.plan import TrialPlan
from tega_sim.rig import ACT_NS, TrialSteering
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
    """Goes through the levels of the practice; ``vest`` are the worn frames, a hundred a second."""

    def __init__(self, *, full_effort: float) -> None:
        super().__init__(_COURSE, full_effort=full_effort)
        self.vest: list[MotorLevels | None] = []

    def act(self, percept: Percept) -> Act:
        """Keep the vest's frame, and go on with the script."""
        self.vest.append(percept.vest)
        return super().act(percept)


def practise(lab: Lab, plan: TrialPlan, person: TrialSteering, number: int = 0) -> float:
    """Let a person of the second version of the rules practise with a trial's object and vest; others do not.

    A person without a vest, or with one that pulses at events, learns nothing, and the bench is not run.
    Returns the time simulated, seconds.
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
