"""Positive controls, replayed vest and rules of the bench: what is worn comes from where the condition says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray

pytest.importorskip("mujoco", reason="needs the extra tega[sim]")

from tega.config import FINGERS
from tega.errors import InvalidValueError
from tega.haptics import MotorLevels, intensity, vest_frame
from tega_sim.conditions import CONDITIONS
from tega_sim.lab import Lab, lab_of
from tega_sim.lift import Lift, other_vest
from tega_sim.operator import Operator, ScriptedOperator, load_parameters, people_digest
from tega_sim.operator.belief import Closure, Panel
from tega_sim.operator.scripted import DEFAULT_COURSE, Step
from tega_sim.plan import FULL_N, TrialPlan
from tega_sim.score import REST_S, SLIP_M_S
from tega_sim.seams import Act, Percept, WorldTruth
from tega_sim.streams import LiftRecorder, Streams
from tega_sim.trial import practise, run_trial
from tega_sim.true_touch import TrueTouch
from tega_sim.world import OBJECTS
from tega_study.silico.simulate import made_study

TOUCH = (*DEFAULT_COURSE[:3], Step(3.8, "done", 3, (0.0, 0.0), 0.0))
"""Reach and close on the object, on the table."""
LET_FALL = (
    *DEFAULT_COURSE[:5],
    Step(6.8, "hold", 1, (0.22, 0.0), 0.0),
    Step(9.0, "done", 1, (0.22, 0.0), 0.0),
)
"""Open the hand up there."""
VEST_TICK_S = 1 / 30


class Wearer(ScriptedOperator):
    def __init__(self, course: tuple[Step, ...]) -> None:
        super().__init__(course)
        self.worn: list[MotorLevels | None] = []

    def act(self, percept: Percept) -> Act:
        self.worn.append(percept.vest)
        return super().act(percept)


@pytest.fixture(scope="module")
def lab() -> Lab:
    return lab_of(3, "live", ())


def operator(lab: Lab, condition: str, name: str = "bag", **plan: Any) -> Operator:
    made = lab.person(TrialPlan.checked({"object": name, "condition": condition, "seed": 3} | plan))
    assert isinstance(made, Operator)
    return made


def lift(
    lab: Lab, condition: str, course: tuple[Step, ...], *, name: str = "container", dark: bool = False
) -> tuple[Wearer, Streams]:
    plan = TrialPlan.checked({"object": name, "condition": condition, "seed": 3, "operator": "scripted"})
    wearer, streams = Wearer(course), Streams()
    run = Lift(lab, plan, wearer, 0, streams=streams, skip_untouched=not dark)
    run.go()
    return wearer, streams


def frames(streams: Streams) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    rows = streams.rows["vest"][:-1]
    return np.array([row[0] for row in rows]), np.array([row[1:] for row in rows], np.int64)


@pytest.mark.parametrize(
    ("condition", "law"),
    [("true-force", "logistic"), pytest.param("ideal-vest", "linear", marks=pytest.mark.slow)],
)
def test_a_true_vest_follows_the_pads_true_forces(lab: Lab, condition: str, law: str) -> None:
    wearer, streams = lift(lab, condition, TOUCH)
    t_s, sent = frames(streams)
    looks_s = streams.array("truth", "t_s")
    forces = np.stack([streams.array("truth", f"{finger}_force_n") for finger in FINGERS], axis=1)
    assert forces.max() > 0.5, "the script touches"
    at = np.searchsorted(looks_s, t_s + 1e-9, side="right") - 1
    for row, reported in zip(forces[at], sent, strict=True):
        displayed = [intensity(f, FULL_N, law=law) if f > 0 else 0.0 for f in row]  # type: ignore[call-overload]
        assert reported.tolist() == vest_frame(displayed, displayed, layout="x40").intensities.tolist()
    # What was sent is what the person's motors are told at the next look.
    last = wearer.worn[-1]
    assert last is not None
    assert last.intensities.tolist() == sent[t_s < looks_s[-1]][-1].tolist()


@pytest.mark.slow
def test_black_cameras_change_a_real_vest_and_no_true_one(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = {condition: lift(lab, condition, TOUCH)[1] for condition in ("true-force", "haptic")}
    dark = np.zeros_like(lab.baselines["thumb"])
    for gel in lab.gels.values():
        monkeypatch.setattr(gel, "frame", lambda _indenters, _number: dark)
    unseen = {condition: lift(lab, condition, TOUCH, dark=True)[1] for condition in seen}
    assert unseen["true-force"].rows["vest"] == seen["true-force"].rows["vest"]
    assert unseen["true-force"].rows["contacts"] != seen["true-force"].rows["contacts"]
    assert unseen["haptic"].rows["vest"] != seen["haptic"].rows["vest"]


@pytest.mark.slow
def test_the_oracle_tells_a_slip_within_a_tick_of_its_onset_and_nothing_before(lab: Lab) -> None:
    _, streams = lift(lab, "oracle", LET_FALL)
    looks_s, speed = streams.array("truth", "t_s"), streams.array("truth", "slip_m_s")
    lifted = streams.array("truth", "lift_off").astype(bool)
    onset_s = looks_s[lifted & (speed >= SLIP_M_S)][0]
    assert onset_s > 6.0, "lifted and held before"
    t_s, sent = frames(streams)
    reported = sent.reshape(len(sent), 2, -1).min(axis=2) > 0  # every motor of both faces
    assert not sent[t_s < onset_s].any()
    first_s = t_s[reported.all(axis=1)][0]
    assert 0 <= first_s - onset_s <= VEST_TICK_S + 1e-6


def truth(speed: float, *, lift_off: bool = True, dropped: bool = False) -> WorldTruth:
    return WorldTruth(0.0, 0.1, lift_off, (1.0,) * 4, 0.0, speed, 0.0, 0.0, dropped, 0.0)


def test_a_slip_is_told_once_until_the_object_has_rested(lab: Lab) -> None:
    touch = TrueTouch("true slips", lab.touch, layout="x40")
    reported = []
    for tick in range(300):
        t_s = tick / 100
        # Slides from 0.5 to 1 s, halts for half of the rest in between, rests, and slides again from 2 s.
        sliding = 0.5 <= t_s < 0.7 or 0.7 + REST_S / 2 <= t_s < 1.0 or t_s >= 2.0
        touch.watch(t_s, truth(0.05 if sliding else 0.0))
        if touch.frame(round(t_s * 1e9)).intensities.any():
            reported.append(t_s)
    assert np.allclose([reported[0], reported[20]], [0.5, 2.0])
    assert len(reported) == 40, "two pulses of 0.2 s"
    for still in (truth(0.05, lift_off=False), truth(0.05, dropped=True)):
        touch = TrueTouch("true slips", lab.touch, layout="x40")
        touch.watch(0.0, still)
        assert not touch.frame(0).intensities.any()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("condition", "name", "view", "of", "course"),
    [
        ("replayed", "bottle", "direct", ("container", "haptic"), TOUCH),
        ("mistimed", "bag", "hidden", ("bottle", "oracle"), LET_FALL),
    ],
)
def test_a_vest_of_another_trial_is_that_one_s_byte_for_byte_and_knows_nothing_of_this_one(
    lab: Lab, condition: str, name: str, view: str, of: tuple[str, str], course: tuple[Step, ...]
) -> None:
    given = {"object": name, "condition": condition, "seed": 3, "operator": "scripted", "view": view}
    plan = TrialPlan.checked(given)
    other = plan.other
    assert (other.object, other.condition, other.seed, other.view) == (*of, 3, view)
    recorded = other_vest(lab, plan, 0)
    streams = Streams()
    run_trial(other, streams=streams)
    assert [(t_s, *frame.intensities.tolist()) for t_s, frame in recorded] == streams.rows["vest"]
    assert any(frame.intensities.any() for _, frame in recorded)
    touching, seen = lift(lab, condition, course, name=name)
    assert course is TOUCH or (seen.array("truth", "slip_m_s") >= SLIP_M_S).any()
    away = (Step(0.0, "reach", 1, (0.0, 0.15), 0.1), Step(course[-1].t_s, "done", 1, (0.0, 0.15), 0.0))
    untouched, free = lift(lab, condition, away, name=name)
    assert not any(free.array("truth", f"{finger}_force_n").any() for finger in FINGERS)
    looks = min(len(touching.worn), len(untouched.worn))
    assert touching.worn[1:looks] == untouched.worn[1:looks]
    times = np.array([t_s for t_s, _ in recorded])
    for check in range(5, len(untouched.worn)):
        # What was written at this very moment is there at the next look.
        newest = int(np.searchsorted(times, check / 100 - 1e-9, side="left")) - 1
        assert untouched.worn[check] == recorded[newest][1]


def test_an_object_of_a_file_is_replayed_the_bench_s_first() -> None:
    spec = OBJECTS["bag"].with_(name="soft-bag", stiffness_n_m=100)
    other = TrialPlan(object="soft-bag", spec=spec, condition="replayed").other
    assert (other.object, other.spec) == ("bottle", None)


def test_who_drops_an_object_learns_from_it_wherever_the_eyes_are(lab: Lab) -> None:
    def needs(view: str) -> list[tuple[float, float]]:
        person = operator(lab, "non-haptic", view=view)
        person.begin("bag", width_m=0.1)
        trial = person._trial
        assert trial is not None
        trial.grip.phase = "hold"
        before = person.beliefs["bag"].need
        for tick in range(20):
            person.act(Percept(tick / 100, truth(0.0, dropped=True), None, 2.0))
        return [before, person.beliefs["bag"].need]

    assert needs("hidden") == needs("aside") == needs("direct")
    before, after = needs("hidden")
    assert after[0] > before[0]


def test_a_vest_of_the_truth_is_not_recorded_as_one_of_pictures(lab: Lab, tmp_path: Path) -> None:
    plan = TrialPlan(object="bag", condition="oracle", seed=3, operator="scripted")
    with pytest.raises(InvalidValueError, match="'oracle' cannot be recorded"):
        Lift(lab, plan, Wearer(TOUCH), 0, recorder=LiftRecorder(tmp_path / "r", real_time=False))


def test_only_the_ideal_vest_is_worn_on_another_skin(lab: Lab) -> None:
    own = operator(lab, "haptic").person
    for condition in CONDITIONS:
        other = operator(lab, condition).person
        assert (other == own) == (condition != "ideal-vest")
        assert msgspec.structs.replace(other, vest=own.vest) == own
    assert operator(lab, "ideal-vest").person.vest.lapse == 0


def test_a_study_names_its_people_by_their_numbers_and_rules(tmp_path: Path) -> None:
    # A written-down name: it changes with the parameters or the rules, and with nothing else of the program.
    assert people_digest("0" * 64) == "74b860d956ee8b83b0586c4231fe7da6f5a817f2d66a788c79d409585dc76611"
    how = {"operators": 1, "seed": 1, "objects": ["bag"], "conditions": ["oracle", "non-haptic"], "trials": 1}
    _, stated = made_study(tmp_path / "s", **how)  # type: ignore[arg-type]
    assert (stated.rules, stated.people_sha256) == (3, people_digest(load_parameters().digest))


@pytest.mark.slow
def test_practice_shows_the_bench_s_own_vest_level_by_level_where_there_is_one(lab: Lab) -> None:
    def odds(condition: str) -> tuple[float, dict[Panel, float], dict[Panel, float]]:
        """Return how long the practice lasts, and what is believed of each panel after it and before."""
        someone = operator(lab, condition, "container")
        plan = TrialPlan.checked({"object": "container", "condition": condition, "seed": 3})
        simulated_s = practise(lab, plan, someone)
        before = Closure(someone.person.grip, someone.person.vest.threshold)
        return simulated_s, someone.beliefs["container"].closure.log_odds, before.log_odds

    simulated_s, after, before = odds("ideal-vest")
    assert 15.0 < simulated_s < 17.0
    assert after != before
    simulated_s, after, before = odds("non-haptic")
    assert (simulated_s, after) == (0.0, before)
