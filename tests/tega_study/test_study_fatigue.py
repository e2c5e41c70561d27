"""A rest shows whether the arm tires: median frequencies of the trials, and squeezes against the first, are events."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest

from reference.study_bench import ScriptedDesk, quick_study
from tega.config import check_tree
from tega.config.calibration import load_calibration, save_calibration
from tega.errors import DeviceUnavailableError
from tega.records import MuscleCondition
from tega_emulators.lab import emulated_lab
from tega_study.analyse import analyse_study
from tega_study.journal import JournalEvent, events_path, read_events
from tega_study.lead.benches import LabBench
from tega_study.lead.experimenter import ENTER, Screen
from tega_study.lead.rest_tasks import RestTask, RestTaskEnd, RunningTask
from tega_study.lead.session import lead_session
from tega_study.page import report_html
from tega_study.plan import read_plan
from tega_study.privacy import export
from tega_study.side_scores import muscle_sentence, squeeze_sentence, squeeze_shares, trial_medians
from tega_study.trials import study_trials


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

    waiting = RunningTask(RestTask("g", "wait", "squeeze", wait))
    assert not waiting.over
    waiting.end()
    assert waiting.over
    assert waiting.result() == "ended by the experimenter"
    failing = RunningTask(RestTask("g", "fail", "squeeze", fail))
    failing.end()
    assert "the amplifier went away" in str(failing.result())
    broken = RunningTask(RestTask("g", "break", "squeeze", lambda _running: RestTaskEnd(value=1 / len(()))))
    broken.end()
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


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="the emulated amplifier is behind a pseudo terminal")
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
