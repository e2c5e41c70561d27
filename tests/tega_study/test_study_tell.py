"""Another program leads a session; trials that break off are repeated, and sessions report trials without data."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from reference.command import call
from reference.processes import until
from reference.study_bench import ScriptedDesk, StandingBench, quick_study
from tega.errors import DeviceUnavailableError, RecordingError
from tega.runtime.clock import ManualClock, SystemClock
from tega_study.cli.run import COMMANDS
from tega_study.journal import events_path, read_events
from tega_study.lead.experimenter import ENTER, Screen
from tega_study.lead.running_trial import Going
from tega_study.lead.session import lead_session
from tega_study.lead.tell import KEYS, CommandFile, board_path, commands_path, notify, read_board
from tega_study.plan import PlannedTrial, read_plan
from tega_study.state import derive
from tega_study.trials import study_trials


@pytest.fixture
def study(tmp_path: Path) -> Path:
    folder = tmp_path / "study"
    quick_study(folder, seed=1, long_rest_s=300.0)
    return folder


def phase(folder: Path) -> str:
    board = read_board(board_path(folder, "p01"))
    return "" if board is None else board.phase


def reported(folder: Path, command: str) -> str:
    words = [sys.executable, "-m", "tega.ui.cli", "study", "tell", str(folder), "p01", command, "--json"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    message: str = json.loads(done.stdout)["phase"]
    return message


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_a_session_is_led_by_other_processes_from_start_to_end(study: Path) -> None:
    session = threading.Thread(
        target=lead_session, args=(study, "p01", StandingBench(), ScriptedDesk()), kwargs={"time_scale": 0.01}
    )
    session.start()
    try:
        for _ in range(2):
            until(lambda: phase(study) == "ready")
            reported(study, "start")
            until(lambda: phase(study) == "trial")
            with commands_path(study, "p01").open("a") as file:  # as a program in another language does it
                file.write('{"do": "mark"}\n{"do": "slip"}\n{"do": "lift it"}\n[[[\n')
            time.sleep(1.2)  # in its first second a trial cannot be ended
            reported(study, "end")
        until(lambda: phase(study) == "ready")
        reported(study, "start")
        until(lambda: not session.is_alive())
    finally:
        if session.is_alive():
            notify(study, "p01", "quit", clock=SystemClock())
        session.join()
    trials = study_trials(study)[1]
    assert [(trial.slips, trial.slips_before) for trial in trials] == [(1, 0)] * 2
    events = read_events(events_path(study, "p01"))
    assert [e.text for e in events if e.kind == "trial_end"] == ["ended by the experimenter"] * 2


def test_commands_press_the_keys_of_the_screen(tmp_path: Path) -> None:
    path = tmp_path / "told.jsonl"
    path.write_text('{"do": "end"}\n')
    clock = ManualClock()
    taken = CommandFile(path, clock)
    assert taken.take() == [], "a command of an earlier session ends no trial of this one"
    with path.open("a") as file:
        file.write('{"do": "start"}\n{"do": "quit"}\n{"do": "sl')
    assert taken.take() == [ENTER, "q", "q"]
    with path.open("a") as file:
        file.write('ip"}\n{"do": 3}\n' + "[" * 200_000 + '\n{"do": "drop"}\n')
    keys = [key for _ in range(9) for key in taken.take()]
    assert keys == ["s", "x"]
    path.write_text("")
    assert taken.take() == []
    with path.open("a") as file:
        file.write('{"do": "undo"}\n')
    assert taken.take() == ["u"]
    with path.open("a") as file:
        file.write('{"do": "start"}\n')
    n_before = taken.n_taken
    clock.sleep_until(4 * 10**9)
    assert taken.take() == [], "given while a typed answer was waited for"
    assert taken.n_taken == n_before + 1
    assert tuple(KEYS) == COMMANDS
    assert {key for keys in KEYS.values() for key in keys} <= set("sdxueazq \n")


def test_where_nobody_leads_a_command_is_refused_and_not_kept_for_later(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(DeviceUnavailableError, match="no program leads the session of p01"):
        notify(study, "p01", "start", clock=SystemClock())
    assert not commands_path(study, "p01").exists()
    assert "no program leads" in call(capsys, "study", "tell", study, "p01", "start", code=3)[1]


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such pipe and link")
@pytest.mark.timeout(30)
def test_no_pipe_is_waited_for_and_no_link_written_through(study: Path, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    assert CommandFile(tmp_path / "pipe", ManualClock()).take() == []
    (tmp_path / "mine.txt").write_text("mine")
    path = commands_path(study, "p01")
    path.parent.mkdir(parents=True)
    path.symlink_to(tmp_path / "mine.txt")
    board = board_path(study, "p01")
    board.write_text(json.dumps({"t_ns": SystemClock().now_ns(), "phase": "ready"}))
    with pytest.raises(RecordingError, match=r"told\.jsonl: is a link"):
        notify(study, "p01", "start", clock=SystemClock(), timeout_s=0.1)
    assert (tmp_path / "mine.txt").read_text() == "mine"


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


def _status(folder: Path, capsys: pytest.CaptureFixture[str]) -> tuple[dict[str, object], str]:
    found = json.loads(call(capsys, "study", "status", folder, "--json")[0])
    return found["participants"][0], call(capsys, "study", "status", folder)[0]


def test_a_trial_that_breaks_off_is_repeated_until_it_has_data(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = _study(tmp_path)
    desk = _Desk(["a", "a", "a"])
    lead_session(folder, "p01", StandingBench(), desk, time_scale=0.001, trials=3)
    state = derive(read_plan(folder).of("p01"), read_events(events_path(folder, "p01")))
    assert (state.next, state.n_over, state.broken_off) == ((1, 4), 0, [1])
    row, displayed = _status(folder, capsys)
    assert (row["over"], row["broken_off"], row["without_data"]) == (0, [1], [])
    assert "broken off and to be repeated: 1" in displayed
    assert "broken off and to be repeated: 1" in desk.said[-1]


def test_a_trial_is_given_up_by_key_and_the_end_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = _study(tmp_path)
    desk = _Desk(["a", "z"], {"trial 1 of 2, again": "k"})
    lead_session(folder, "p01", StandingBench(), desk, time_scale=0.001)
    assert "give up trial 1" in desk.offered
    state = derive(read_plan(folder).of("p01"), read_events(events_path(folder, "p01")))
    assert state.next is None
    assert state.without_data == {1: "given up", 2: "stopped for safety"}
    message = "2 of 2 trials without data: 1 (given up), 2 (stopped for safety)"
    assert message in desk.said
    row, displayed = _status(folder, capsys)
    assert (row["over"], row["without_data"]) == (2, [1, 2])
    assert message in displayed
    trials = study_trials(folder)[1]
    found = [(trial.status, trial.counts) for trial in trials]
    assert found == [("skipped", False), ("aborted_safety", False)]


class _Broken(StandingBench):
    """Devices that stop in every trial, or before it begins."""

    def __init__(self, *, begins: bool) -> None:
        super().__init__()
        self._begins = begins

    def run(self, _trial: PlannedTrial, going: Going, _folder: Path) -> None:
        going.notify("armed", "")
        while self._begins and not going.may_go():
            pass
        if self._begins:
            going.begin(0)
        raise DeviceUnavailableError("the amplifier is gone")


@pytest.mark.parametrize(("begins", "message"), [(True, "broke off 3 times"), (False, "cannot begin")])
def test_a_session_without_an_experimenter_does_not_repeat_for_ever(
    *, begins: bool, message: str, tmp_path: Path
) -> None:
    folder = _study(tmp_path)
    with pytest.raises(DeviceUnavailableError, match=f"{message}: the amplifier is gone"):
        lead_session(folder, "p01", _Broken(begins=begins), _Desk([]), time_scale=0.001, auto=True)
    kinds = [event.kind for event in read_events(events_path(folder, "p01"))]
    assert (kinds[-1], kinds.count("trial_start")) == ("session_stop", 3 * begins)
