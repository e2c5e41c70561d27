"""A session is led on an emulated lab, and its rests show whether the arm tires."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest

from reference.study_bench import Experimenter, ScriptedDesk, events_of, quick_study, study
from tega.config import check_tree
from tega.config.calibration import load_calibration, save_calibration
from tega.errors import DeviceUnavailableError
from tega.records import MuscleCondition
from tega.runtime.files.toml_text import tree_text
from tega_emulators.lab import emulated_lab
from tega_study.analyse import analyse_study
from tega_study.coupling import read_course
from tega_study.journal import JournalEvent, events_path, read_events
from tega_study.lead.benches import LabBench
from tega_study.lead.experimenter import ENTER, Screen
from tega_study.lead.rest_tasks import RestTask, RestTaskEnd, RunningTask
from tega_study.lead.session import lead_session
from tega_study.page import report_html
from tega_study.plan import read_plan
from tega_study.privacy import export
from tega_study.side_scores import muscle_sentence, squeeze_sentence, squeeze_shares, trial_medians
from tega_study.touch_picture import finger_rows, pictures_of
from tega_study.trials import course_path, study_trials


def slow(test: Any) -> Any:
    unix = pytest.mark.skipif(os.name == "nt", reason="Windows has no pseudo terminals")
    return pytest.mark.slow(unix(test))


@slow
def test_the_vest_rests_in_the_other_condition_and_touch_is_kept(tmp_path: Path) -> None:
    pytest.importorskip("foxglove")
    from reference.sessions import read_recorded
    from tega.recording.mcap_reader import McapReader

    folder = study(tmp_path, conditions=["haptic", "non-haptic", "event-gated"])
    plan = read_plan(folder)
    lab_folder = tmp_path / "lab"
    lab_folder.mkdir()
    with emulated_lab(lab_folder, emg_hz=250.0, vest=True, fingers=("thumb",)) as lab:
        bench = LabBench(check_tree(lab.tree, {}, base=lab_folder).config, where="emulated")
        # Off the table, a slip, at the mark; then it is held.
        desk = Experimenter({"trial": " s "})
        state = lead_session(folder, "p01", bench, desk, time_scale=0.1)
    assert state.next is None
    t_ns = [event.t_ns for event in events_of(folder) if event.kind in {"trial_start", "trial_end"}]
    assert t_ns[2] - t_ns[1] >= 0.3 * 0.1 * 1e9
    trials = study_trials(folder)[1]
    assert [(trial.success, trial.slips, trial.slips_before) for trial in trials] == [(True, 1, 0)] * 3
    for trial, planned in zip(trials, plan.of("p01"), strict=True):
        where = folder / "recordings" / "p01" / f"{planned.id}-a1"
        reported = read_recorded(next(where.glob("*.mcap"))).head.config.stages.mapping.name
        assert reported == ("pulses" if trial.condition == "event-gated" else "equal-steps")
        facts = json.loads((where / "trial.json").read_text())
        strongest = touched = 0.0
        first_ns = None
        for message in McapReader(next(where.glob("*.mcap"))).messages():
            if message.topic == "/vest/frame" and max(message.value.intensities) > strongest:
                strongest = max(message.value.intensities)
                first_ns = message.value.t_ns if first_ns is None else first_ns
            elif message.topic == "/tactile/thumb/contact":
                touched = max(touched, message.value.eda_norm)
        assert touched > 0.5
        # Pressed before it begins and to its end, the fingertip has no event to tell.
        assert (strongest > 0) == (trial.condition == "haptic")
        if first_ns is not None:  # nothing is felt before the trial begins
            assert facts["zero_ns"] + first_ns >= facts["started_ns"]
        assert read_course(course_path(folder, trial)).eda.max() > 0.5
    pictures = pictures_of(folder, trials, ["bag"], "haptic")
    assert list(pictures) == [trial.id for trial in trials if trial.condition == "haptic"]
    (row,) = finger_rows(pictures, trials)
    assert row.finger == "thumb"
    assert (row.eda_norm or 0) > 0.5
    assert row.cci > 0.0


@slow
def test_what_is_felt_in_a_session_counts_to_the_day_of_the_participant(tmp_path: Path) -> None:
    pytest.importorskip("foxglove")
    folder = study(tmp_path, simulated=False, window_s=2.0, seed=1)
    assert read_plan(folder).of("p01")[0].condition == "haptic"
    with emulated_lab(tmp_path, emg_hz=250.0, vest=True, fingers=("thumb",)) as lab:
        # The maxima come from a file, which names nobody.
        assert set(lab.tree["calibration"]) == {"file"}
        (tmp_path / "lab.toml").write_text(tree_text(lab.tree))
        words = ["study", "run", str(folder), "p01", "--lab", str(tmp_path / "lab.toml"), "--yes"]
        words += ["--trials", "1", "--time-scale", "0.1"]
        subprocess.run([sys.executable, "-m", "tega.ui.cli", *words], check=True)
    worn = json.loads((tmp_path / "calibrations/people/p01/vest-dose.json").read_bytes())
    assert sum(sum(run["dose_s"]) for run in worn) > 0


def condition(*median_hz: float) -> MuscleCondition:
    return MuscleCondition(t_ns=0, median_hz=median_hz, slope_percent_per_min=(math.nan,) * len(median_hz))


def muscles(*values_hz: float, channel: str = "ch1") -> list[JournalEvent]:
    return [JournalEvent(n=1, t_ns=0, kind="muscles", item=channel, value=value) for value in values_hz]


def test_a_trial_s_value_is_the_middle_of_its_seconds_of_effort() -> None:
    nan = math.nan
    seen = [condition(80.0, nan), condition(90.0, nan), condition(200.0, nan), condition(nan, nan)]
    assert trial_medians(seen) == {"ch1": 90.0}
    assert trial_medians([]) == {}


@pytest.mark.parametrize(
    ("values_hz", "message"),
    [
        ([], []),
        ([100.0], []),
        ([100.0, 90.0], ["ch1 −10 %"]),
        ([100.0, 84.0], ["ch1 −16 %", "ch1: tired"]),
        # Three trials together: one odd trial tires nobody.
        ([100.0, 100.0, 100.0, 100.0, 100.0, 70.0], ["ch1 −10 %"]),
        ([90.0, 100.0, 110.0, 95.0, 80.0, 80.0, 80.0], ["ch1 −20 %", "ch1: tired"]),
        ([80.0, 88.0], ["ch1 +10 %"]),
    ],
)
def test_the_newest_trials_are_held_against_the_first(values_hz: list[float], message: list[str]) -> None:
    lines = muscle_sentence(muscles(*values_hz))
    assert len(lines) == len(message)
    assert all(part in line for part, line in zip(message, lines, strict=True))


def squeezes(*message: float | str) -> list[JournalEvent]:
    """Return events: a squeeze for each number, and what else is named."""
    return [
        JournalEvent(n=n, t_ns=n, kind="squeeze", value=one)
        if isinstance(one, float)
        else JournalEvent(n=n, t_ns=n, kind=one, trial=1)  # type: ignore[arg-type]
        for n, one in enumerate(message, start=1)
    ]


@pytest.mark.parametrize(
    ("message", "shares"),
    [
        ((), []),
        ((0.8,), [1.0]),
        ((0.8, "trial_start", "trial_end", 0.6), [1.0, 0.75]),
        # The first was half-hearted and was done again before the first trial.
        ((0.4, 0.8, "trial_start", "trial_end", 0.6), [0.5, 1.0, 0.75]),
        (("trial_start", "trial_end", 0.6, "trial_start", "trial_end", 0.3), [1.0, 0.5]),
        ((0.0, "trial_start", 0.5), [1.0]),
    ],
)
def test_a_squeeze_is_a_share_of_the_last_before_the_first_trial(
    message: tuple[float | str, ...], shares: list[float]
) -> None:
    events = squeezes(*message)
    assert list(squeeze_shares(events).values()) == pytest.approx(shares)
    displayed = f"squeeze: {100 * shares[-1]:.0f} % of the first" if len(shares) > 1 else None
    assert squeeze_sentence(events) == ([] if displayed is None else [displayed])


def test_a_task_of_a_rest_is_ended_by_the_experimenter_and_tells_what_was_wrong() -> None:
    def wait(running: RunningTask) -> RestTaskEnd:
        while True:
            running.show("wait", (), None)

    def fail(_running: RunningTask) -> RestTaskEnd:
        raise DeviceUnavailableError("the amplifier went away", "look at its cable")

    def running(run: Any) -> RunningTask:
        return RunningTask(RestTask("g", "a task", "squeeze", run))

    waiting, failing = running(wait), running(fail)
    assert not waiting.over
    for task in (waiting, failing, broken := running(lambda _running: RestTaskEnd(value=1 / len(())))):
        task.end()
    assert waiting.over
    assert waiting.result() == "ended by the experimenter"
    assert "the amplifier went away" in str(failing.result())
    with pytest.raises(ZeroDivisionError):
        broken.result()


class _Looking(ScriptedDesk):
    """Has the person squeeze before each trial, ends it after some seconds of effort, and keeps what the rests show."""

    def __init__(self, tire: Callable[[], object]) -> None:
        super().__init__()
        self._tire = tire
        self.displayed: list[str] = []

    def observe(self, screen: Screen) -> None:
        if screen.phase == "ready" != self.phase:
            squeezed = self.phase == "task" or ("g", "a squeeze against the first") not in screen.keys
            self.waiting.append(ENTER if squeezed else "g")
        if screen.phase in {"rest", "ready"}:
            self.displayed += screen.lines
        if screen.phase == "trial" and float(screen.big.split(" s of")[0]) > 4:
            self.waiting.append("e")

    def say(self, text: str) -> None:
        super().say(text)
        if text.startswith("a squeeze against the first"):
            self._tire()


@slow
def test_an_emulated_session_keeps_the_muscles_frequency_of_each_trial(tmp_path: Path) -> None:
    pytest.importorskip("foxglove")
    folder = tmp_path / "study"
    quick_study(folder, seed=1)
    lab_folder = tmp_path / "lab"
    lab_folder.mkdir()
    with emulated_lab(lab_folder, emg_hz=1000.0, fingers=("thumb",)) as lab:
        made = load_calibration(lab_folder / "calibration.toml")
        assert made.emg is not None
        weak = msgspec.structs.replace(made.emg, maxima=(1e-4,) * 3)  # what is tensed is full effort
        save_calibration(msgspec.structs.replace(made, emg=weak), lab_folder / "calibration.toml")
        bench = LabBench(check_tree(lab.tree, {}, base=lab_folder).config, where="emulated")
        desk = _Looking(lambda: lab.emg.say("effort 0.5"))
        lead_session(folder, "p01", bench, desk, time_scale=0.1)
    events = read_events(events_path(folder, "p01"))
    for trial in read_plan(folder).of("p01"):
        mine = {e.item: e.value for e in events if e.kind == "muscles" and e.trial == trial.trial}
        assert set(mine) == {"ch1", "ch2", "ch3"}
        assert all(value is not None and 20 < value < 450 for value in mine.values())
    assert any(line.startswith("median frequency against the first trials: ch1 ") for line in desk.displayed)
    # The muscles worked half as much from the first squeeze on; nothing else of the bench was opened for it.
    first, second = (event for event in events if event.kind == "squeeze")
    assert (first.trial, second.trial) == (0, 1)
    assert squeeze_shares(events)[second.n] == pytest.approx(0.5, abs=0.1), (first, second, desk.said)
    share = study_trials(folder)[1][0].squeeze_share
    assert share == squeeze_shares(events)[second.n]
    assert f"squeeze: {100 * share:.0f} % of the first" in desk.displayed
    page = report_html(analyse_study(folder)[0], {})
    assert "squeeze after" in page
    assert f">{100 * share:.0f}\N{NO-BREAK SPACE}%<" in page
    export(folder, tmp_path / "open", key="secret")
    copied = read_events(events_path(tmp_path / "open", "p01"))
    assert len(copied) == len(events)
    assert {event.value for event in copied if event.kind in {"muscles", "squeeze"}} == {None}
