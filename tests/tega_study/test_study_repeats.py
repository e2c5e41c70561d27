"""A trial that breaks off is repeated until it has data or is given up, and sessions report trials without data."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from reference.study_bench import ScriptedDesk, StandingBench, quick_study
from tega.errors import DeviceUnavailableError
from tega.ui.cli.main import cli
from tega_study.journal import events_path, read_events
from tega_study.lead.experimenter import ENTER, Screen
from tega_study.lead.running_trial import Going
from tega_study.lead.session import lead_session
from tega_study.plan import PlannedTrial, read_plan
from tega_study.state import derive
from tega_study.trials import study_trials


class _Desk(ScriptedDesk):
    """Presses keys by screen: in a trial the next of ``ends``, in a rest ``in_rest``, else Enter."""

    def __init__(self, ends: list[str], in_rest: dict[str, str] | None = None) -> None:
        super().__init__(answer="the robot is broken")
        self._ends, self._in_rest, self._displayed = ends, in_rest or {}, ""
        self.offered: set[str] = set()

    def observe(self, screen: Screen) -> None:
        self.offered |= {words for _, words in screen.keys}
        if self._displayed == screen.phase + screen.heading:
            return
        self._displayed = screen.phase + screen.heading
        if screen.phase == "trial":
            self.waiting.append(self._ends.pop(0))
        elif screen.phase == "ready":
            extra = next((keys for words, keys in self._in_rest.items() if words in screen.heading), "")
            self.waiting += [*extra, ENTER]


def _study(folder: Path) -> Path:
    quick_study(folder / "study", rest_s=0, change_rest_s=0, long_rest_s=0)
    return folder / "study"


def _status(folder: Path) -> tuple[dict[str, object], str]:
    displayed = CliRunner().invoke(cli, ["study", "status", str(folder)])
    found = CliRunner().invoke(cli, ["study", "status", str(folder), "--json"])
    return json.loads(found.stdout)["participants"][0], displayed.stdout


def test_a_trial_that_breaks_off_is_repeated_until_it_has_data(tmp_path: Path) -> None:
    folder = _study(tmp_path)
    desk = _Desk(["a", "a", "a"])
    lead_session(folder, "p01", StandingBench(), desk, time_scale=0.001, trials=3)
    state = derive(read_plan(folder).of("p01"), read_events(events_path(folder, "p01")))
    assert (state.next, state.n_over, state.broken_off) == ((1, 4), 0, [1])
    row, displayed = _status(folder)
    assert (row["over"], row["broken_off"], row["without_data"]) == (0, [1], [])
    assert "broken off and to be repeated: 1" in displayed
    assert "broken off and to be repeated: 1" in desk.said[-1]


def test_a_trial_is_given_up_by_key_and_the_end_says_so(tmp_path: Path) -> None:
    folder = _study(tmp_path)
    desk = _Desk(["a", "z"], {"trial 1 of 2, again": "k"})
    lead_session(folder, "p01", StandingBench(), desk, time_scale=0.001)
    assert "give up trial 1" in desk.offered
    state = derive(read_plan(folder).of("p01"), read_events(events_path(folder, "p01")))
    assert state.next is None
    assert state.without_data == {1: "given up", 2: "stopped for safety"}
    message = "2 of 2 trials without data: 1 (given up), 2 (stopped for safety)"
    assert message in desk.said
    row, displayed = _status(folder)
    assert (row["over"], row["without_data"]) == (2, [1, 2])
    assert message in displayed
    trials = study_trials(folder)[1]
    found = [(trial.status, trial.counts) for trial in trials]
    assert found == [("skipped", False), ("aborted_safety", False)]


class _Broken(StandingBench):
    """Devices that stop in every trial."""

    def run(self, _trial: PlannedTrial, going: Going, _folder: Path) -> None:
        going.notify("armed", "")
        while not going.may_go():
            pass
        going.begin(0)
        raise DeviceUnavailableError("the amplifier is gone")


def test_a_session_without_an_experimenter_does_not_repeat_for_ever(tmp_path: Path) -> None:
    folder = _study(tmp_path)
    with pytest.raises(DeviceUnavailableError, match="broke off 3 times: the amplifier is gone"):
        lead_session(folder, "p01", _Broken(), _Desk([]), time_scale=0.001, auto=True)
