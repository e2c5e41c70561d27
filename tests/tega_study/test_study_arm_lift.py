"""Lift and drop are measured by the arm's height and the fingertips; keys correct them and both are kept."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.study_bench import StandingBench, study
from tega.loop.snapshot import LoopView
from tega.runtime.clock import SystemClock
from tega.stages.metrics import contact_record
from tega.tactile import ContactMetrics, contact_metrics
from tega_study.journal import Journal, JournalEvent, events_path, read_events
from tega_study.lead.benches import SimulatedBench
from tega_study.lead.running_trial import ARM, ArmLift, Going
from tega_study.lead.trial import LedTrial, undo_last
from tega_study.plan import PlannedTrial, read_plan
from tega_study.trials import study_trials


class _ByArm(SimulatedBench):
    """The simulated bench without the object's height: what is measured is the arm, the joints and the fingertips."""

    sees_height = False
    measures_height = True
    true: dict[str, float]

    def run(self, trial: PlannedTrial, going: Going, folder: Path) -> None:
        self.true = {}
        observe = going.observe

        def keep(kind: Any, t_ns: int, value: float = 0.0) -> None:
            if kind not in {"height", "drop"}:
                observe(kind, t_ns, value)
            if value > 0:
                self.true.setdefault("lift_off", t_ns / 1e9)
            if kind == "height" and value >= 0.2:
                self.true.setdefault("up", t_ns / 1e9)
            elif kind == "height":
                self.true.pop("up", None)

        going.observe = keep  # type: ignore[method-assign]
        super().run(trial, going, folder)


def _led(folder: Path, bench: Any, keys: dict[float, str]) -> tuple[list[JournalEvent], float]:
    """Lead a trial, keys by time since its start; return its events and its beginning."""
    left = dict(sorted(keys.items()))
    with Journal(events_path(folder, "p01")) as journal:
        own: dict[str, Any] = {"bench": bench, "journal": journal, "clock": SystemClock()}
        trial = read_plan(folder).of("p01")[0]
        led = LedTrial(folder, trial, 1, task="lift", window_s=15.0, time_scale=0.001, **own)
        pressed: list[str] = []
        while not led.step(pressed):
            due = [at_s for at_s in left if led.going.elapsed_s() >= at_s]
            pressed = [left.pop(at_s) for at_s in due]
        return journal.events, (led.going.started_ns or 0) / 1e9


@pytest.mark.slow
def test_lift_off_and_hold_by_the_arm_are_those_of_the_object(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    folder = study(tmp_path)
    bench = _ByArm(read_plan(folder), "p01", real_time=False)
    events, begin_s = _led(folder, bench, {})
    at_s = {e.kind: e.t_ns / 1e9 - begin_s for e in events if e.source == ARM}
    assert at_s["lift_off"] == pytest.approx(bench.true["lift_off"], abs=0.15)
    assert at_s["lifted"] == pytest.approx(bench.true["up"] + 1.0, abs=0.25)
    (end,) = [event for event in events if event.kind == "trial_end"]
    assert (end.success, end.status, end.text) == (True, "done", "lifted and held")
    (trial,) = study_trials(folder)[1]
    assert trial.success
    assert trial.lift_off_s == pytest.approx(at_s["lift_off"])


class _Raised(StandingBench):
    """Devices whose arm rises with an object to 0.25 m and loses it in the air if asked."""

    measures_height = True

    def __init__(self, *, drops: bool) -> None:
        super().__init__(own_time=True)
        self._drops = drops

    def run(self, _trial: PlannedTrial, going: Going, _folder: Path) -> None:
        metrics = {held: _contact(held=held) for held in (False, True)}
        going.notify("armed", "stands ready")
        while not going.may_go():
            pass
        going.begin(0)
        for tick in range(300):
            time.sleep(0.001)  # a key can be pressed meanwhile
            t_s = tick / 30
            height_m = 0.4 + min(max(t_s - 2, 0) * 0.1, 0.25)
            held = t_s >= 1 and not (self._drops and t_s >= 3.5)
            t_ns = round(t_s * 1e9)
            contact = contact_record("thumb", t_ns, metrics[held])
            going.view(LoopView(t_ns, {"thumb": contact}, None, None, None, {}, arm_height_m=height_m))
        while not going.over():
            pass


def _contact(*, held: bool) -> ContactMetrics:
    rows, columns = np.mgrid[:240, :320]
    baseline = np.full((240, 320, 3), 100, np.uint8)
    frame = baseline.copy()
    if held:
        frame[(rows - 120) ** 2 + (columns - 160) ** 2 < 30**2] = 180
    return contact_metrics(frame, baseline)


def test_an_object_that_leaves_the_hand_in_the_air_is_dropped(tmp_path: Path) -> None:
    folder = study(tmp_path)
    events, begin_s = _led(folder, _Raised(drops=True), {})
    (drop,) = [event for event in events if event.kind == "drop"]
    assert drop.source == ARM
    assert drop.t_ns / 1e9 - begin_s == pytest.approx(3.5, abs=0.05)
    (end,) = [event for event in events if event.kind == "trial_end"]
    assert (end.success, end.status) == (False, "failed_task")
    with Journal(events_path(folder, "p01")) as journal:
        assert undo_last(journal, 1, 1, t_ns=end.t_ns) is not None
        journal.add("override", t_ns=end.t_ns, trial=1, success=True, source="experimenter")
    (trial,) = study_trials(folder)[1]
    assert (trial.success, trial.drops) == (True, 0)
    assert drop in read_events(events_path(folder, "p01"))


def test_a_keyed_lift_off_replaces_the_measured_one_and_both_are_kept(tmp_path: Path) -> None:
    folder = study(tmp_path)
    plain = study(tmp_path / "plain")
    _led(plain, _Raised(drops=False), {})
    events, _ = _led(folder, _Raised(drops=False), {1.0: " "})
    assert [e.source for e in events if e.kind == "lift_off"] == ["experimenter", ARM]
    measured_s, keyed_s = (study_trials(one)[1][0].lift_off_s for one in (plain, folder))
    assert measured_s == pytest.approx(2.05, abs=0.05)
    assert keyed_s == pytest.approx(1.0, abs=0.5)
    assert [study_trials(one)[1][0].success for one in (plain, folder)] == [True, True]


def test_an_object_put_down_is_not_dropped_and_missing_pictures_drop_nothing() -> None:
    def dropped(courses: list[tuple[float, float, bool | None]]) -> list[float]:
        lift = ArmLift()
        looks = (lift.check(t_s, arm_m, touching=touching) for t_s, arm_m, touching in courses)
        return [check.dropped_s for check in looks if check.dropped_s is not None]

    up = [(k / 10, 0.3 + min(k, 20) / 100, True) for k in range(40)]
    assert dropped([*up, *((4 + k / 10, 0.5, False) for k in range(10))]) == [pytest.approx(3.9)]
    down = [(4 + k / 10, 0.5 - k / 100, True) for k in range(20)]
    assert not dropped([*up, *down, *((6 + k / 10, 0.3, False) for k in range(10))])
    assert not dropped([*up, *((4 + k / 10, 0.5, None) for k in range(10))])


def test_a_hand_that_lags_behind_its_command_holds_something() -> None:
    lift = ArmLift()
    for k in range(40):
        check = lift.check(k / 10, 0.3 + min(k, 20) / 100, touching=k < 20, level=4, closure=3.5)
        assert check.dropped_s is None
    assert check.height_m == pytest.approx(0.2)
