# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""Whole trials on the simulated bench: the loop closes, equal plans give equal bits; objects carried and filled."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

pytest.importorskip("mujoco", reason="needs the extra tega[sim]")

from tega.errors import ConfigError, InvalidValueError, RecordingError
from tega.records import Contact, Intent
from tega.records.bus import Bus
from tega_sim import trials as trials_module
from tega_sim.filling import HOLD_S, PORTION_N, Filling
from tega_sim.gel import Gel
from tega_sim.lab import lab_of
from tega_sim.operator.motor import AWAY_M
from tega_sim.operator.scripted import DEFAULT_COURSE, ScriptedOperator, Step
from tega_sim.plan import TrialPlan, TrialResult
from tega_sim.score import ON_MARK_M
from tega_sim.seams import Act, Percept
from tega_sim.streams import Streams
from tega_sim.trial import run_trial
from tega_sim.trials import plan_trials, read_results, run_trials, summarise_trials
from tega_sim.world import World

SCRIPTED = TrialPlan(object="container", operator="scripted", seed=3)


@pytest.fixture(scope="module")
def lift() -> tuple[TrialResult, Streams]:
    streams = Streams()
    return run_trial(SCRIPTED, streams=streams), streams


@pytest.mark.slow
def test_a_script_lifts_the_container_through_the_whole_loop(lift) -> None:
    result, streams = lift
    assert result.success
    assert [event.kind for event in result.events][:2] == ["lift_off", "lifted"]
    assert result.lift_off_s < result.lifted_s < 15.0
    assert 0.2 < streams.array("truth", "object_height_m").max() < 0.25
    assert result.plan == SCRIPTED
    # The script aims at level 3 by muscles alone: what moved the hand came through filters, levels and CAN frames.
    assert {1, 3} <= set(streams.array("levels", "fused").tolist())
    # Something was felt while it was held, and nothing before the hand got there.
    vest = np.array([row[1:] for row in streams.rows["vest"]])
    t_s = streams.array("vest", "t_s")
    assert vest[(t_s > result.lifted_s) & (t_s < result.lifted_s + 1)].max() > 0
    assert vest[t_s < 1.0].max() == 0
    assert vest[-1].max() == 0


def test_sensors_and_truth_agree_on_touch_and_tables_hold_what_arrays_do(tmp_path: Path) -> None:
    opened = (Step(3.8, "hold", 1, (0.0, 0.0), 0.0), Step(5.2, "done", 1, (0.0, 0.0), 0.0))
    streams = Streams()
    run_trial(SCRIPTED, person=ScriptedOperator((*DEFAULT_COURSE[:3], *opened)), streams=streams)
    for finger in ("index", "middle"):
        truth_t_s, force_n = streams.array("truth", "t_s"), streams.array("truth", f"{finger}_force_n")
        seen = streams.array("contacts", "in_contact", where=("finger", finger))
        seen_t_s = streams.array("contacts", "t_s", where=("finger", finger))
        # A release is told within a tenth of a second.
        then_s = seen_t_s - 0.025
        longest_n = [
            force_n[(truth_t_s > t - 0.12) & (truth_t_s <= t + 0.01)].max(initial=0.0) for t in then_s
        ]
        assert seen.any()
        assert not seen[np.array(longest_n) == 0].any()
    streams.write_tables(tmp_path)
    lines = (tmp_path / "truth.csv").read_text().splitlines()
    assert lines[0].startswith("t_s,object_height_m,lift_off,thumb_force_n")
    assert len(lines) - 1 == len(streams.rows["truth"])
    assert float(lines[-1].split(",")[0]) == pytest.approx(streams.array("truth", "t_s")[-1])


class Unseeing(Streams):
    """Wants no pictures, so that only sums over their cells are computed."""

    def listen(self, bus: Bus) -> None:
        bus.subscribe(Contact, self._contact, vital=True)
        bus.subscribe(Intent, self._intent, vital=True)


@pytest.mark.slow
def test_a_lift_repeats_bit_for_bit_by_sums_over_cells_and_with_every_fingertip_painted(
    lift, monkeypatch: pytest.MonkeyPatch
) -> None:
    result, streams = lift
    painted: list[int] = []
    frame = Gel.frame

    def paint(gel: Gel, indenters: Any, index: int, **named: Any) -> Any:
        painted.append(index)
        return frame(gel, indenters, index, **named)

    monkeypatch.setattr(Gel, "frame", paint)
    for kept, skips in ((Unseeing(), True), (Streams(), False)):
        assert run_trial(SCRIPTED, streams=kept, skip_untouched=skips) == result
        assert (not painted) == skips
        assert kept.rows == streams.rows


@pytest.mark.slow
@pytest.mark.parametrize("condition", ["non-haptic", "constant", "true-force"])
def test_pictures_that_nobody_sees_change_nothing(condition: str, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = TrialPlan.checked({"object": "bag", "condition": condition, "seed": 2})
    rendered = run_trial(plan, skip_untouched=False, practised=False)
    n_rendered: list[int] = []
    lab_of(plan.seed, plan.preset, plan.settings)  # its calibration is of pictures
    for made in ("frame", "sums"):
        monkeypatch.setattr(Gel, made, lambda _gel, _indenters, index, **_named: n_rendered.append(index))
    assert run_trial(plan, practised=False) == rendered
    assert not n_rendered


class Onlooker:
    def __init__(self) -> None:
        self.vests: list[object] = []

    def begin(self, name: str, *, width_m: float, trial: int = 0, rest_s: float = 60.0) -> None:
        pass

    def act(self, percept: Percept) -> Act:
        self.vests.append(percept.vest)
        return Act(0.0, (0.0, 0.15), "done" if percept.t_s > 0.3 else "reach")


@pytest.mark.parametrize(
    ("condition", "worn"), [("haptic", True), ("non-haptic", False), ("silent", True), ("unfelt", True)]
)
def test_the_condition_decides_what_is_worn(condition: str, worn: bool) -> None:
    person = Onlooker()
    result = run_trial(TrialPlan(object="bag", condition=condition, seed=3), person=person)  # type: ignore[arg-type]
    assert (result.duration_s, result.success) == (0.31, False)
    assert (person.vests[-1] is not None) == worn


def test_the_vest_is_switched_off_at_once_and_an_observer_sees_pictures_poses_and_muscles() -> None:
    person, seen = Onlooker(), list[Any]()
    plan = TrialPlan(object="bottle", seed=3)
    run_trial(plan, person=person, observer=seen.append, muted=lambda: len(person.vests) > 15)
    assert person.vests[10] is not None
    assert person.vests[-1] is None
    assert len(seen) == 10 + 1  # ten ticks, and the end
    assert [state.loop.state for state in seen[-2:]] == ["active", "stopped"]
    state = seen[-2]
    assert set(state.images) == {"thumb", "index", "middle", "ring"}
    assert state.poses.shape == (len(state.shapes), 7)
    assert state.emg.samples.shape == (300, 3)
    assert state.rows["object"] == "bottle"
    assert state.loop.angles_rad is not None


@pytest.mark.parametrize(
    "wrong",
    [
        {"object": "brick"},
        {"condition": "loud"},
        {"seed": -1},
        {"practice": 1000},
        {"preset": "best"},
        {"settings": ["vest.driver=hid-vest"]},
    ],
)
def test_a_plan_with_a_mistake_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises((InvalidValueError, ConfigError)):
        TrialPlan.checked({"object": "bag"} | wrong)


def test_nobody_at_the_keyboard_is_refused() -> None:
    with pytest.raises(InvalidValueError, match="keyboard"):
        run_trial(TrialPlan(object="bag", operator="keyboard"))


def test_practice_comes_before_the_lift_that_counts() -> None:
    person = Onlooker()
    result = run_trial(TrialPlan(object="bag", practice=2), person=person)
    assert result.simulated_s == pytest.approx(3 * 0.31)
    assert len(person.vests) == 3 * 32


@pytest.mark.slow
def test_results_do_not_depend_on_the_number_of_workers_and_are_kept(lift, tmp_path: Path) -> None:
    plans = [SCRIPTED, *plan_trials(["bag"], ["haptic"], [5], operator="scripted", friction=[0.2])]
    out = tmp_path / "trials.jsonl"
    results = run_trials(plans, jobs=2, out=out)
    assert results[0] == lift[0]
    assert list(read_results(out)) == plans
    rows = [(row.object, row.condition, row.n) for row in summarise_trials(results)]
    assert rows == [("container", "haptic", 1), ("bag_mu20", "haptic", 1)]


def test_what_a_file_holds_is_not_run_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[str] = []

    def once(plan: TrialPlan) -> TrialResult:
        done.append(plan.object)
        return run_trial(plan, person=Onlooker())

    monkeypatch.setattr(trials_module, "run_trial", once)
    plans = plan_trials(["bag", "bottle", "container"], ["haptic"], [5])
    out = tmp_path / "trials.jsonl"
    reported = []
    run_trials(plans[:2], out=out)
    # A run that was ended while it wrote: its last line is cut.
    out.write_bytes(out.read_bytes()[:-40])
    run_trials(plans, out=out, progress=lambda *subject: reported.append(subject))
    assert done == ["bag", "bottle", "bottle", "container"]
    assert reported[0] == ("trials", 1, 3)
    assert [json.loads(line)["object"] for line in out.read_text().splitlines()] == [p.object for p in plans]
    content = out.read_bytes()
    run_trials(plans[1:], out=out)
    assert out.read_bytes() == content
    out.write_bytes(re.sub(rb'"person":"[0-9a-f]+"', b'"person":"00ff"', content))
    with pytest.raises(RecordingError, match="00ff"):
        run_trials(plans, out=out)
    out.write_text("something else\n")
    with pytest.raises(RecordingError, match="line 1"):
        run_trials(plans, out=out)


@pytest.mark.slow
def test_a_vest_that_tells_nothing_changes_nothing() -> None:
    without, *shams = (
        msgspec.structs.replace(
            # Practising with a vest is simulated, whatever it shows.
            run_trial(TrialPlan(object="bag", condition=condition, seed=1)),
            condition="haptic",
            simulated_s=0.0,
        )
        for condition in ("non-haptic", "silent", "unfelt")
    )
    assert without.lift_off_s is not None
    assert shams == [without, without]


def tried(**fields: Any) -> TrialResult:
    plan = {"object": "bag", "condition": "non-haptic", "seed": 3, "operator": "scripted", **fields}
    return run_trial(TrialPlan.checked(plan))


@pytest.mark.slow
def test_an_object_is_carried_to_the_second_mark_and_stands_there_let_go_of() -> None:
    done = tried(task="place")
    assert done.off_mark_m is not None
    assert (done.placed, done.success, done.drops) == (True, True, 0)
    assert 0 <= done.off_mark_m < ON_MARK_M < AWAY_M
    assert msgspec.json.decode(msgspec.json.encode(done), type=TrialResult) == done
    lost = tried(task="place", friction=0.25, mass_kg=0.8)  # it slides out of the hand on its way
    assert (lost.placed, lost.success) == (False, False)
    assert lost.off_mark_m is not None


@pytest.mark.slow
def test_a_simulated_person_places_an_object_and_a_lift_without_a_second_mark_says_nothing_of_one() -> None:
    person = tried(object="container", operator="simulated", task="place")
    assert person.placed
    assert person.duration_s > 15
    lift = tried()
    assert (lift.success, lift.placed, lift.off_mark_m) == (True, None, None)
    with pytest.raises(InvalidValueError, match="task"):
        tried(task="throw")


def test_portions_come_while_the_object_is_held_and_stay() -> None:
    filling = Filling(4)
    assert filling.force_n(3.0, holding=False) == 0.0
    weights = [filling.force_n(5.0 + 0.01 * n, holding=True) for n in range(round(100 * HOLD_S))]
    assert weights == sorted(weights)
    assert {round(weight / PORTION_N, 9) for weight in weights} == set(range(16))
    assert filling.force_n(5.0 + HOLD_S, holding=False) == weights[-1] == pytest.approx(15 * 0.1 * 9.81)
    assert filling.force_n(99.0, holding=False) == weights[-1]
    again, *others = (
        [other.force_n(5.0 + 0.01 * n, holding=True) for n in range(100)]
        for other in map(Filling, range(4, 8))
    )
    assert weights[:100] == again
    assert all(weights[:100] != other for other in others)


def test_a_push_bears_on_the_object_until_the_next() -> None:
    world = World("bag")
    for force_n in (6.0, 6.0, 0.0):
        world.push(force_n)
        assert world.data.xfrc_applied[:, 2].sum() == pytest.approx(-force_n)
    for force_n in (-1.0, math.nan, math.inf):
        with pytest.raises(InvalidValueError, match="force_n"):
            world.push(force_n)


@pytest.mark.slow
def test_a_grip_that_lifts_the_container_loses_it_when_it_is_filled() -> None:
    lifted, lost, kept = (
        tried(object="container", mass_kg=0.35, task=task, friction=friction)
        for task, friction in (("lift", 0.7), ("fill", 0.7), ("fill", 1.4))
    )
    assert [one.success for one in (lifted, lost, kept)] == [True, False, True]
    assert kept.duration_s > lifted.duration_s + 5
