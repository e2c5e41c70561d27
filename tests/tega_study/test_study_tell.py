# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""Another program leads a session; trials that break off are repeated; arm and fingertips measure lift and drop."""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from reference.command import call
from reference.installed import program
from reference.processes import until
from reference.scripted import touching
from reference.study_bench import ScriptedDesk, StandingBench, begin_ready, study, trial_led
from tega.errors import DeviceUnavailableError, RecordingError
from tega.loop.snapshot import LoopView
from tega.runtime.clock import ManualClock, SystemClock
from tega_study.cli.run import COMMANDS
from tega_study.journal import Journal, JournalEvent, events_path, read_events
from tega_study.lead.benches import SimulatedBench
from tega_study.lead.experimenter import ENTER, Screen
from tega_study.lead.running_trial import ARM, ArmLift, Going
from tega_study.lead.session import lead_session
from tega_study.lead.tell import KEYS, CommandFile, board_path, commands_path, notify, read_board
from tega_study.lead.trial import undo_last
from tega_study.plan import PlannedTrial, read_plan
from tega_study.state import derive
from tega_study.trials import study_trials


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return study(tmp_path, rest_s=0, change_rest_s=0, long_rest_s=0, window_s=120.0)


def phase(folder: Path) -> str:
    board = read_board(board_path(folder, "p01"))
    return "" if board is None else board.phase


def reported(folder: Path, command: str) -> str:
    words = (sys.executable, "-m", "tega.ui.cli", "study", "tell", folder, "p01", command, "--json")
    return str(json.loads(program(*words).stdout)["phase"])


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_a_session_is_led_by_other_processes_from_start_to_end(folder: Path) -> None:
    session = threading.Thread(
        target=lead_session,
        args=(folder, "p01", StandingBench(), ScriptedDesk()),
        kwargs={"time_scale": 0.01},
    )
    session.start()
    try:
        for _ in range(2):
            until(lambda: phase(folder) == "ready")
            reported(folder, "start")
            until(lambda: phase(folder) == "trial")
            with commands_path(folder, "p01").open("a") as file:  # as a program in another language does it
                file.write('{"do": "mark"}\n{"do": "slip"}\n{"do": "lift it"}\n[[[\n')
            time.sleep(1.2)  # in its first second a trial cannot be ended
            reported(folder, "end")
        until(lambda: phase(folder) == "ready")
        reported(folder, "start")
        until(lambda: not session.is_alive())
    finally:
        if session.is_alive():
            notify(folder, "p01", "quit", clock=SystemClock())
        session.join()
    trials = study_trials(folder)[1]
    assert [(trial.slips, trial.slips_before) for trial in trials] == [(1, 0)] * 2
    events = read_events(events_path(folder, "p01"))
    assert [e.text for e in events if e.kind == "trial_end"] == ["ended by the experimenter"] * 2


def test_commands_press_the_keys_of_the_screen(tmp_path: Path) -> None:
    path = tmp_path / "told.jsonl"

    def add(text: str) -> None:
        with path.open("a") as file:
            file.write(text)

    add('{"do": "end"}\n')
    clock = ManualClock()
    taken = CommandFile(path, clock)
    assert taken.take() == [], "a command of an earlier session ends no trial of this one"
    add('{"do": "start"}\n{"do": "quit"}\n{"do": "sl')
    assert taken.take() == [ENTER, "q", "q"]
    add('ip"}\n{"do": 3}\n' + "[" * 200_000 + '\n{"do": "drop"}\n')
    keys = [key for _ in range(9) for key in taken.take()]
    assert keys == ["s", "x"]
    path.write_text("")
    assert taken.take() == []
    add('{"do": "undo"}\n')
    assert taken.take() == ["u"]
    add('{"do": "start"}\n')
    n_before = taken.n_taken
    clock.sleep_until(4 * 10**9)
    assert taken.take() == [], "given while a typed answer was waited for"
    assert taken.n_taken == n_before + 1
    assert tuple(KEYS) == COMMANDS
    assert {key for keys in KEYS.values() for key in keys} <= set("sdxueazq \n")


def test_where_nobody_leads_a_command_is_refused_and_not_kept_for_later(folder, capsys):
    with pytest.raises(DeviceUnavailableError, match="no program leads the session of p01"):
        notify(folder, "p01", "start", clock=SystemClock())
    assert not commands_path(folder, "p01").exists()
    assert "no program leads" in call(capsys, "study", "tell", folder, "p01", "start", code=3)[1]


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such pipe and link")
@pytest.mark.timeout(30)
def test_no_pipe_is_waited_for_and_no_link_written_through(folder: Path, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    assert CommandFile(tmp_path / "pipe", ManualClock()).take() == []
    (tmp_path / "mine.txt").write_text("mine")
    path = commands_path(folder, "p01")
    path.parent.mkdir(parents=True)
    path.symlink_to(tmp_path / "mine.txt")
    board = board_path(folder, "p01")
    board.write_text(json.dumps({"t_ns": SystemClock().now_ns(), "phase": "ready"}))
    with pytest.raises(RecordingError, match=r"told\.jsonl: is a link"):
        notify(folder, "p01", "start", clock=SystemClock(), timeout_s=0.1)
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


def _status(folder: Path, capsys: pytest.CaptureFixture[str]) -> tuple[dict[str, object], str]:
    found = json.loads(call(capsys, "study", "status", folder, "--json")[0])
    return found["participants"][0], call(capsys, "study", "status", folder)[0]


def test_a_trial_that_breaks_off_is_repeated_until_it_has_data(folder, capsys):
    desk = _Desk(["a", "a", "a"])
    lead_session(folder, "p01", StandingBench(), desk, time_scale=0.001, trials=3)
    state = derive(read_plan(folder).of("p01"), read_events(events_path(folder, "p01")))
    assert (state.next, state.n_over, state.broken_off) == ((1, 4), 0, [1])
    row, displayed = _status(folder, capsys)
    assert (row["over"], row["broken_off"], row["without_data"]) == (0, [1], [])
    assert "broken off and to be repeated: 1" in displayed
    assert "broken off and to be repeated: 1" in desk.said[-1]


def test_a_trial_is_given_up_by_key_and_the_end_says_so(folder, capsys):
    desk = _Desk(["A", "Z"], {"trial 1 of 2, again": "k"})
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
def test_a_session_without_an_experimenter_does_not_repeat_for_ever(*, begins, message, folder):
    with pytest.raises(DeviceUnavailableError, match=f"{message}: the amplifier is gone"):
        lead_session(folder, "p01", _Broken(begins=begins), _Desk([]), time_scale=0.001, auto=True)
    kinds = [event.kind for event in read_events(events_path(folder, "p01"))]
    assert (kinds[-1], kinds.count("trial_start")) == ("session_stop", 3 * begins)


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
        led = trial_led(folder, journal, bench)
        pressed: list[str] = []
        while not led.step(pressed):
            due = [at_s for at_s in left if led.going.elapsed_s() >= at_s]
            pressed = [left.pop(at_s) for at_s in due]
        return journal.events, (led.going.started_ns or 0) / 1e9


@pytest.mark.slow
def test_lift_off_and_hold_by_the_arm_are_those_of_the_object(folder: Path) -> None:
    pytest.importorskip("mujoco")
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
        begin_ready(going)
        for tick in range(300):
            time.sleep(0.001)  # a key can be pressed meanwhile
            t_s = tick / 30
            height_m = 0.4 + min(max(t_s - 2, 0) * 0.1, 0.25)
            held = t_s >= 1 and not (self._drops and t_s >= 3.5)
            t_ns = round(t_s * 1e9)
            contact = touching(3000 * held, t_ns=t_ns)
            going.view(LoopView(t_ns, {"thumb": contact}, None, None, None, {}, arm_height_m=height_m))
        while not going.over():
            pass


def test_an_object_that_leaves_the_hand_in_the_air_is_dropped(folder: Path) -> None:
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


def test_a_keyed_lift_off_replaces_the_measured_one_and_both_are_kept(folder: Path, tmp_path: Path) -> None:
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
