"""Run one trial on the simulated bench: a person lifts an object with the real loop in between.

Everything in it is simulated but the loop: filters, levels, controller, contact metrics, vest frames and CAN frames
are those of a run with devices. Example::

    from tega_sim.trial import TrialPlan, run_trial
    run_trial(TrialPlan(object="bag", condition="haptic", seed=1)).slips

Persons practise before: they feel the vest level by level. The practice runs on the bench, since the vest's frame at a
closure depends on object, hand and metric. A script without error holds each level on the object,
standing on the table, through EMG, decoder, hand, camera frames and vest; the person watches the hand and feels the
condition's vest. Practice causes no fatigue, and the person learns as from one run through the levels.
"""

from __future__ import annotations

from collections.abc import Callable

from tega.haptics import MotorLevels
from tega.ui.view.state import ViewState
from tega_sim.conditions import ARMS
from tega_sim.lab import Lab, lab_of
from tega_sim.lift import Lift
from tega_sim.operator.acting import PRACTICE_S, PRACTISED_LEVELS, Operator
from tega_sim.operator.scripted import ScriptedOperator, Step
from tega_sim.plan import TrialPlan, TrialResult
from tega_sim.rig import ACT_NS, TrialSteering
from tega_sim.seams import Act, Percept
from tega_sim.streams import LiftRecorder, Streams

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


def practise(
    lab: Lab, plan: TrialPlan, person: TrialSteering, number: int = 0, *, with_vest: bool = True
) -> float:
    """Let a simulated person practise with a trial's object and vest; other operators do not.

    A person without a vest, or with one that pulses at events, learns nothing, and the bench is not run.
    Returns the time simulated, seconds.
    """
    arm = ARMS[plan.condition]
    if not isinstance(person, Operator):
        return 0.0
    if not with_vest or arm.pulses or arm.sham == "off" or arm.skin == "none":
        person.practise(plan.object, lambda _t_s, _level: None)
        return 0.0
    script = LevelScript(full_effort=lab.calibrated.full_effort)
    run = Lift(lab, plan, script, number, lift_by_s=_END_S + 1.0)
    run.go()
    first, last, look_s = round(_REACHED_S * 1e9) // ACT_NS, len(script.vest) - 1, ACT_NS / 1e9
    person.practise(plan.object, lambda t_s, _level: script.vest[min(first + round(t_s / look_s), last)])
    return run.end_s


__all__ = ["TrialPlan", "TrialResult", "run_trial"]


def run_trial(
    plan: TrialPlan,
    *,
    person: TrialSteering | None = None,
    real_time: bool = False,
    observer: Callable[[ViewState], None] | None = None,
    streams: Streams | None = None,
    recorder: LiftRecorder | None = None,
    stop: Callable[[], bool] = lambda: False,
    paused: Callable[[], bool] = lambda: False,
    muted: Callable[[], bool] = lambda: False,
    skip_untouched: bool = True,
    practised: bool = True,
) -> TrialResult:
    """Run a trial.

    Args:
        plan: The plan of the trial.
        person: Operator instead of the plan's; required for ``keyboard``.
        real_time: Whether to keep to the machine's clock; the results are the same.
        observer: Called with the state to display, thirty times a second of simulated time.
        streams: Receives the truth and the sensors' readings of the lift that counts.
        recorder: What records the lift that counts.
        stop: Asked all the time whether to end; the trial then counts as it stands.
        paused: Asked all the time whether to stand still.
        muted: Called at every vest frame; returns whether the user has switched the vest off.
        skip_untouched: Whether fingertips that nothing touches go without rendering, and all of them where
            nothing that is felt, kept or looked at hangs on their pictures; the results are the same.
        practised: Whether a simulated person learns before what the vest shows; else it means nothing to them.
    """
    lab = lab_of(plan.seed, plan.preset, plan.settings)
    someone = lab.person(plan) if person is None else person
    simulated_s, fatigue = practise(lab, plan, someone, with_vest=practised), 0.0
    for lift in range(plan.practice + 1):
        last = lift == plan.practice
        run = Lift(
            lab,
            plan,
            someone,
            lift,
            fatigue=fatigue,
            streams=streams if last else None,
            recorder=recorder if last else None,
            watched=observer is not None,
            muted=muted,
            skip_untouched=skip_untouched,
        )
        run.go(real_time=real_time, observer=observer, stop=stop, paused=paused)
        simulated_s += run.end_s
        fatigue = run.fatigue
        if stop():
            break
    result = run.result(simulated_s)
    if recorder is not None:
        recorder.finish(result)
    return result
