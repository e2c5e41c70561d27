"""Run one trial on the simulated bench: a person lifts an object with the real loop in between.

Everything in it is simulated but the loop: filters, levels, controller, contact metrics, vest frames and CAN frames
are those of a run with devices. Example::

    from tega_sim.trial import TrialPlan, run_trial
    run_trial(TrialPlan(object="bag", condition="haptic", seed=1)).slips
"""

from __future__ import annotations

from collections.abc import Callable

from tega.ui.view.state import ViewState
from tega_sim.lab import lab_of
from tega_sim.lift import Lift
from tega_sim.plan import TrialPlan, TrialResult
from tega_sim.practice import practise
from tega_sim.recorded import LiftRecorder
from tega_sim.rig import TrialSteering
from tega_sim.streams import Streams

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
    """
    lab = lab_of(plan.seed, plan.preset, plan.settings)
    someone = lab.person(plan) if person is None else person
    simulated_s, fatigue = practise(lab, plan, someone), 0.0
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
