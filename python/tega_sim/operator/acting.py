"""Simulate the operator, who takes percepts in and gives acts out, a hundred times a second.

The person sees and, where the vest is worn, feels; decides twenty times a second; muscles follow. With and without
the vest everything but the vest's own percepts is the same: guesses, costs, gaze, errors, random streams.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

from tega.errors import InvalidValueError
from tega.haptics import MotorLevels
from tega_sim.operator.belief import Closure, ObjectBelief, Panel
from tega_sim.operator.grip import GripDecisions
from tega_sim.operator.motor import MuscleMotor, SimulatedForearm
from tega_sim.operator.person import PersonNumbers, stream
from tega_sim.operator.vest_sense import POLL_S, Skin
from tega_sim.operator.vision import Eyes, SeenEvent, ViewName
from tega_sim.seams import Act, Percept

PRACTISED_LEVELS = (2, 3, 4, 5, 4, 3, 2, 3, 4, 5)
"""Levels gone through in practice."""

PRACTICE_S = 1.5
"""How long each is held, seconds."""

_TICK_S = 0.01
_VEST_READ_S = 0.5
# How long after a command has been followed the closure aimed at is a fair guess of the real one.
_FRESH_S = 1.0
_PANELS: tuple[Panel, Panel] = ("front", "back")


@dataclass
class TrialOfPerson:
    """State of a simulated person that is reset at the start of each trial."""

    grip: GripDecisions
    eyes: Eyes
    motor: MuscleMotor
    pending: list[SeenEvent] = field(default_factory=list)
    last_s: float = -_TICK_S
    next_decision_s: float = 0.0
    next_vest_read_s: float = 0.0
    lost: bool = False


class Operator:
    """A person at the task.

    Beliefs about objects, and the skin's adaptation, last from trial to trial; nothing else does.

    Args:
        seed: Seed of everything random in the person's behaviour.
        feels: Whether the person feels the vest at all; ``False`` is the control who cannot feel it.
        full_effort: Excitation at which a channel's mean is Emax, which practice with the calibrated system has
            taught (:func:`tega_sim.operator.calibrate`); none means the effort of the calibration itself.
        view: Sight of the hand while the object is held. A dropped object is noticed in every view, and shows the
            person that the grip was too loose.
        away_m: How far back of where it stood the object is put down, metres.

    Attributes:
        pulses: Whether the vest shows contact, slip and release only, which the person knows: intensity then has no
            meaning, and a pulse on both faces while the object is held is answered like a slip that is seen.
        bears_m: Narrowing from which the next object counts as harmed, metres, as shown to the person; 0 if unknown.

    Raises:
        InvalidValueError: ``full_effort`` is not above 0.

    Example:
        >>> from tega_sim.operator import Operator, typical_person
        >>> from tega_sim.seams import Percept, WorldTruth
        >>> operator = Operator(typical_person(), seed=1)
        >>> operator.begin("bottle", width_m=0.07)
        >>> nothing = WorldTruth(0.0, 0.0, False, (0.0,) * 4, 0.0, 0.0, 0.0, 0.0, False, 0.1)
        >>> operator.act(Percept(0.0, nothing, None)).phase
        'reach'
    """

    def __init__(
        self,
        person: PersonNumbers,
        *,
        seed: int,
        feels: bool = True,
        full_effort: float | None = None,
        view: ViewName = "direct",
        away_m: float = 0.0,
    ) -> None:
        self._away_m = away_m
        self._view = view
        self.person = person
        self.pulses = False
        self.bears_m = 0.0
        self._seed, self._feels = seed, feels
        self._full = person.motor.calibration_effort if full_effort is None else full_effort
        if not self._full > 0:
            raise InvalidValueError(f"full_effort = {self._full} is not above 0")
        self._skin = Skin(person.vest, person.vision)
        self.beliefs: dict[str, ObjectBelief] = {}
        self._last_belief: ObjectBelief | None = None
        self._trial: TrialOfPerson | None = None

    def begin(self, name: str, *, width_m: float, trial: int = 0, rest_s: float = 60.0) -> None:
        """Start a trial.

        Beliefs from earlier trials with an object of this name are remembered; its width is plain to see.
        Another number of the trial gives other random draws. ``rest_s`` is how long the person has rested, 0
        or more.
        """
        if not width_m > 0 or not rest_s >= 0:
            raise InvalidValueError(
                f"width_m = {width_m} m has to be above 0, rest_s = {rest_s} s at least 0"
            )
        self._start(name, width_m, trial, rest_s)

    def act(self, percept: Percept) -> Act:
        """Take in a percept and return the person's action; time must not go back within a trial."""
        trial, t_s = self._trial or self._start("object", 0.07, 0, 0.0), percept.t_s
        dt_s = t_s - trial.last_s
        if dt_s <= 0:
            raise InvalidValueError(
                f"t_s = {t_s} s is not after {trial.last_s} s", "begin() a new trial first"
            )
        trial.last_s = t_s
        grip = trial.grip
        trial.pending += trial.eyes.observe(
            t_s, dt_s, percept.scene, carried=grip.carrying, lifting=grip.phase == "lift", held=grip.held
        )
        if percept.scene.dropped and grip.held and not trial.lost:
            trial.lost = True
            grip.belief.slipped(grip.closure.x, grip.closure.var)
        if self._feels:
            self._skin.feel(t_s, dt_s, percept.vest)
        if t_s >= trial.next_decision_s - 1e-9:
            trial.next_decision_s = t_s + POLL_S
            self._decide(t_s, percept, trial)
        excitation = trial.motor.step(t_s, dt_s)
        return Act(excitation, grip.forearm.step(t_s), grip.phase)

    def practise(self, name: str, displayed: Callable[[float, float], MotorLevels | None]) -> None:
        """Before the lift, close and open the hand level by level, watching the object and feeling the vest.

        The person learns what each panel does at each closure, and nothing else. ``displayed`` returns the
        frame sent to the vest, by the time in seconds and the closure in levels.
        """
        belief = self._recall(name, 0.0)
        if not self._feels:
            return
        self._skin.begin(0.0, partial(stream, self._seed, "operator", name, "practice"))
        glances_per_level = round(PRACTICE_S / POLL_S)
        for n in range(len(PRACTISED_LEVELS) * glances_per_level):
            level = PRACTISED_LEVELS[n // glances_per_level]
            for tick in range(5):
                t_s = n * POLL_S + tick * _TICK_S
                self._skin.feel(t_s, _TICK_S, displayed(t_s, float(level)))
            self._skin.check(t_s, POLL_S)
            if (n + 1) % glances_per_level == 0:
                # The pose is in plain sight for several looks.
                belief.closure.set(float(level), self.person.vision.pose_sd**2 / 4)
                for panel in _PANELS:
                    if (felt := self._skin.mean_log(panel, t_s - _VEST_READ_S)) is not None:
                        belief.closure.feel(panel, *felt)

    def _decide(self, t_s: float, percept: Percept, trial: TrialOfPerson) -> None:
        grip = trial.grip
        if self._feels and percept.vest is not None:
            self._attend(t_s, trial)
        if grip.age_s(t_s) >= self.person.motor.effort_wait_s:
            if grip.touching:
                grip.judge_effort(trial.motor.felt_level(), self.person.motor.effort_sd)
            elif percept.closure is not None:
                grip.judge_pose(trial.eyes.pose(percept.closure))
        due = [event for event in trial.pending if event.due_s <= t_s]
        trial.pending = [event for event in trial.pending if event.due_s > t_s]
        decision = grip.decide(t_s, POLL_S, due, percept.scene)
        if decision is None:
            return
        level, change = decision
        if change is None:
            trial.motor.command(level)
        else:
            trial.motor.shift(change)

    def _attend(self, t_s: float, trial: TrialOfPerson) -> None:
        skin, grip = self._skin, trial.grip
        skin.check(t_s, POLL_S)
        closure = grip.closure
        heeded = tuple(closure.trust(panel) > 0.5 for panel in _PANELS)
        if grip.phase == "grasp" and (self.pulses or any(heeded)) and (event := skin.onset(t_s)) is not None:
            trial.pending.append(event)
        if self.pulses:
            if grip.held and (event := skin.slip_pulse(t_s)) is not None:
                trial.pending.append(event)
            return
        if any(heeded) and grip.steady(t_s):
            # As the person was instructed, stronger is tighter, unless this object has taught the contrary.
            front, back = (
                None if not heed else not (closure.known(panel) and closure.slope(panel) < 0)
                for panel, heed in zip(_PANELS, heeded, strict=True)
            )
            if (event := skin.weaker(t_s, (front, back))) is not None:
                trial.pending.append(event)
        if t_s >= trial.next_vest_read_s and grip.touching and grip.settled(t_s, _VEST_READ_S):
            trial.next_vest_read_s = t_s + _VEST_READ_S
            fresh = not grip.settled(t_s, _VEST_READ_S + _FRESH_S)
            for panel in _PANELS:
                if (felt := skin.mean_log(panel, t_s - _VEST_READ_S)) is not None:
                    closure.feel(panel, *felt, fresh=fresh)

    def _recall(self, name: str, rest_s: float) -> ObjectBelief:
        """Belief about an object: faded from its last trial, or a first guess close to the last object's."""
        belief = self.beliefs.get(name)
        if belief is None:
            closure = Closure(self.person.grip, self.person.vest.threshold)
            belief = self.beliefs[name] = ObjectBelief(self.person.grip, closure)
            if self._last_belief is not None:
                mean, sd = belief.need
                belief.need = (mean + self.person.grip.carry_over * (self._last_belief.need[0] - mean), sd)
        else:
            # The skin adapts and recovers; how far, the person cannot know.
            vest = self.person.vest
            belief.fade(math.log1p(vest.adapt_gain) ** 2 * -math.expm1(-rest_s / vest.adapt_s))
        self._last_belief = belief
        return belief

    def _start(self, name: str, width_m: float, trial: int, rest_s: float) -> TrialOfPerson:
        person, process = self.person, partial(stream, self._seed, "operator", name, trial)
        self._skin.begin(rest_s, process)
        forearm = SimulatedForearm((0.0, person.forearm.back_m))
        aim, sense = process("aim"), process("effort sense")
        self._trial = TrialOfPerson(
            GripDecisions(person, self._recall(name, rest_s), forearm, away_m=self._away_m),
            Eyes(person.vision, process, width_m=width_m, view=self._view, bears_m=self.bears_m),
            MuscleMotor(person.motor, full_effort=self._full, aim=aim, sense=sense),
        )
        self._trial.motor.command(1)
        return self._trial
