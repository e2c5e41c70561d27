"""One rule of lift, hold and success: the same verdict from simulation, scene camera and study, at the same moments."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from reference.study_bench import StandingBench, begin_ready, study, trial_led
from tega.stages.events.outcomes import LiftRule, StableReading, success
from tega_scene.courses import SceneCourses
from tega_scene.outcomes import SceneRule
from tega_scene.smoothing import Course
from tega_sim.score import TrialScorer
from tega_sim.seams import WorldTruth
from tega_study.journal import Journal, events_path
from tega_study.lead.running_trial import Going
from tega_study.plan import PlannedTrial
from tega_study.trials import study_trials

Height = Callable[[float], float]


def ramp(begin_s: float, end_s: float, top_m: float) -> Height:
    return lambda t_s: top_m * min(max((t_s - begin_s) / (end_s - begin_s), 0.0), 1.0)


def twice(t_s: float) -> float:
    return 0.22 if 6.0 <= t_s <= 6.8 else 0.21 if t_s >= 9.0 else 0.0


@pytest.mark.parametrize(
    ("height_m", "held_s", "begun", "complete"),
    [
        (ramp(5, 8, 0.25), (7.4, 8.4), True, True),
        (lambda t_s: 0.1 if t_s > 7.9 else ramp(5, 8, 0.25)(t_s), None, False, False),
        (ramp(13.2, 14.0, 0.2), (14.0, 15.0), True, True),
        (ramp(13.8, 14.6, 0.2), (14.6, 15.6), True, False),
        (ramp(14.5, 15.1, 0.2), (15.1, 16.1), False, False),
        (twice, (9.0, 10.0), True, True),
        (ramp(5, 8, 0.1999), None, False, False),
    ],
)
def test_both_readings_of_a_stable_second(height_m, held_s, begun, complete):
    for stable, lifted in (("begun", begun), ("complete", complete)):
        rule = LiftRule(stable=stable)  # type: ignore[arg-type]
        for tenth in range(201):
            rule.height(tenth / 10, height_m(tenth / 10))
        assert rule.held_s == (None if held_s is None else pytest.approx(held_s))
        assert rule.lifted == lifted
        assert rule.verdict(20.0) == ("lifted" if lifted else "too late")
        assert success(rule, ["lift_off", "slip"]) == lifted
        assert not success(rule, ["drop"])


@pytest.mark.parametrize(("stable", "open_at_14_5"), [("begun", "open"), ("complete", "too late")])
def test_a_trial_is_open_as_long_as_it_can_succeed(stable: StableReading, open_at_14_5: str) -> None:
    rule = LiftRule(stable=stable)
    assert rule.verdict(14.0) == "open"
    assert rule.verdict(14.5) == open_at_14_5
    rule = LiftRule()
    rule.height(14.9, 0.2)
    assert rule.verdict(15.5) == "open"
    rule.check(15.9)
    assert rule.verdict(15.9) == "lifted"


class _Raising(StandingBench):
    sees_height = True

    def __init__(self, height_m: Height) -> None:
        super().__init__(own_time=True)
        self._height_m = height_m

    def run(self, _trial: PlannedTrial, going: Going, _folder: Path) -> None:
        begin_ready(going)
        for hundredth in range(1700):
            going.observe("height", hundredth * 10_000_000, self._height_m(hundredth / 100))


def _by_study(folder: Path, height_m: Height) -> bool:
    folder = study(folder)
    with Journal(events_path(folder, "p01")) as journal:
        led = trial_led(folder, journal, _Raising(height_m))
        while not led.step([]):
            pass
    return study_trials(folder)[1][0].success


def _by_simulation(height_m: Height) -> bool:
    scorer = TrialScorer(0.006)
    for hundredth in range(1700):
        t_s = hundredth / 100
        h = height_m(t_s)
        truth = WorldTruth(t_s, h, h > 0, (1.0, 1.0, 1.0, 1.0), 0.0, 0.0, 0.0, 0.0, False, 0.0)
        scorer.take(t_s, truth, placing=False)
    scorer.close()
    return scorer.success


def _by_camera(height_m: Height) -> bool:
    t_s = np.arange(1700) / 100
    height, still = np.array([height_m(float(t)) for t in t_s]), np.zeros(1700)
    rise, flat = Course(height, still, still), Course(still, still, still)
    rule = SceneRule(SceneCourses(t_s, rise, rise, flat, flat), 0.006)
    rule.go()
    return rule.scorer.success


@pytest.mark.parametrize(("reached_s", "lifted"), [(13.9, True), (14.9, True), (15.1, False)])
def test_simulation_camera_and_study_agree(reached_s: float, lifted: bool, tmp_path: Path) -> None:
    height_m = ramp(reached_s - 2, reached_s, 0.2)
    assert _by_simulation(height_m) == lifted
    assert _by_camera(height_m) == lifted
    assert _by_study(tmp_path, height_m) == lifted
