"""A session is led from the first trial to the last, whatever stops it, and the vest is what the plan says."""

from __future__ import annotations

import io
import re
import sys
import time
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest

from reference.processes import until
from reference.study_bench import (
    Experimenter,
    LiftingBench,
    ScriptedDesk,
    StandingBench,
    events_of,
    kinds,
    study,
    trial_led,
)
from tega.errors import InvalidValueError
from tega.runtime.clock import SystemClock
from tega_study.analyse import analyse_study
from tega_study.coupling import read_course
from tega_study.journal import Journal, counting, events_path
from tega_study.lead.benches import SimulatedBench
from tega_study.lead.experimenter import ENTER, LineDesk, Screen
from tega_study.lead.questions import KEYS, QUESTIONS, BlockQuestions, answer_of, blocks_to_ask, raw_tlx
from tega_study.lead.rest_tasks import RestTask, RestTaskEnd
from tega_study.lead.session import lead_session
from tega_study.lead.tell import board_path, read_board
from tega_study.page import report_html
from tega_study.plan import read_plan
from tega_study.privacy import export
from tega_study.ratings import ratings
from tega_study.score.recorded import read_reel, recorded_trials
from tega_study.state import derive, rehearsed, resume
from tega_study.trials import course_path, study_trials


def test_answers_and_raw_tlx() -> None:
    items = [question.item for question in QUESTIONS[:6]]
    ratings = dict(zip(items, (70.0, 35.0, 50.0, 25.0, 60.0, 40.0), strict=True))
    assert raw_tlx(ratings) == pytest.approx(46.6666666667)
    assert raw_tlx({**ratings, "tlx.effort": None}) is None
    assert [answer_of(key) for key in KEYS] == [5.0 * n for n in range(21)]
    for key in ("v", "A", "7", "", "ab", "\x1b[A", ENTER):
        with pytest.raises(ValueError, match=f"^{re.escape(key)}$"):
            answer_of(key)


def test_an_answer_is_one_key_and_can_be_taken_back_until_the_last_is_kept(tmp_path: Path) -> None:
    folder = study(tmp_path, trials=2)
    plan = read_plan(folder)
    with Journal(events_path(folder, "p01")) as journal:
        journal.add("session_start", t_ns=0, text=plan.settings.plan_sha256, item="simulated")
        block = [trial.trial for trial in plan.of("p01") if trial.block == 1]
        for number in block:
            journal.add("trial_start", t_ns=number * 10**9, trial=number)
            journal.add("trial_end", t_ns=number * 10**9 + 1, trial=number, status="done", success=True)
        rest = {trial.trial for trial in plan.of("p01")} - set(block)
        assert blocks_to_ask(plan.of("p01"), journal.events, rest) == [block[-1]]

        def requested() -> BlockQuestions:
            return BlockQuestions(journal, SystemClock(), block[-1], "p01")

        block_one = requested()
        for key in "sdx":  # keyed a moment too late, when the trial was over
            block_one.press(key)
        assert "rating" not in kinds(journal.events)
        for key in [ENTER, *"ah7", ENTER, "\x7f", "i"]:
            block_one.press(key)
        screen = block_one.screen()
        assert (screen.big, screen.heading) == ("Temporal Demand", "p01 · question 3 of 11")
        assert screen.lines[:2] == ["How hurried or rushed was the pace of the task?", "0 low … 100 high"]
        assert " ".join(screen.lines[2:]).split() == [w for n, k in enumerate(KEYS) for w in (k, str(5 * n))]
        again = requested()  # the program was stopped here
        again.press(ENTER)
        for key in "kfmu-bcqe":
            again.press(key)
        assert again.screen().big == "all answered"
        assert blocks_to_ask(plan.of("p01"), journal.events, rest) == []
        for key in "<<c":
            again.press(key)
        assert not again.over
        for key in ["d", ENTER, "k"]:  # the last one came too soon, and takes nothing back
            again.press(key)
        assert again.over
        counted = [e for e in counting(journal.events, block[-1], 1) if e.kind == "rating"]
        assert [e.item for e in counted] == [question.item for question in QUESTIONS]
        keyed = ["a", "i", *"kfmu-bc", "c", "d"]
        assert [e.value for e in counted] == [answer_of(key) for key in keyed]
        assert {e.source for e in counted} == {"participant"}
    condition = plan.of("p01")[block[-1] - 1].condition
    found = {use.item: use.median for use in ratings(folder) if use.condition == condition}
    assert found["tlx.physical"] == 40.0, "the answer that was taken back does not count"
    assert found["raw NASA-TLX"] == pytest.approx((0 + 40 + 50 + 25 + 60 + 100) / 6)
    assert "comfort.vest" not in found
    assert study_trials(folder)[1], "an answer that was taken back damages no session"


@pytest.mark.slow
def test_a_simulated_session_goes_from_the_first_trial_to_the_last(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    folder = study(tmp_path)
    bench = SimulatedBench(read_plan(folder), "p01", real_time=False)
    desk = Experimenter({"trial": "d", "ready": "uf"})
    assert lead_session(folder, "p01", bench, desk, time_scale=0.1).next is None
    events = events_of(folder)
    assert [event.trial for event in events if event.kind == "trial_end"] == [1, 2]
    for trial in (1, 2):
        own = [event for event in events if event.trial == trial and event.kind != "rating"]
        t_ns = {event.kind: event.t_ns for event in reversed(own)}
        assert t_ns["trial_start"] < t_ns["lift_off"] < t_ns["lifted"] == t_ns["trial_end"]
        # The experimenter saw a deformation in each trial, took that back, and corrected it to a failure.
        keyed = [event for event in own if event.source == "experimenter"]
        assert kinds(keyed) == ["deformation", "undo", "override"]
    trials = study_trials(folder)[1]
    assert [trial.success for trial in trials] == [False, False]
    # Each block is a trial here, so everybody was asked twice.
    ratings = [event for event in events if event.kind == "rating"]
    assert [event.item for event in ratings] == [question.item for question in QUESTIONS] * 2
    assert {event.value for event in ratings} == {40.0}
    for done in trials:
        course = read_course(course_path(folder, done))
        assert len(course.t_s) > 20
        assert course.cci.max() > 0
    # What is kept of it can be shown to a rater: in words, where the object is.
    for displayed in recorded_trials(folder, "p01")[0]:
        _, height, *_ = read_reel(displayed).lines(displayed.length_ns)
        assert float(height.removeprefix("height: ").removesuffix(" cm")) > 19
    board = read_board(board_path(folder, "p01"))
    assert board is not None
    assert board.phase == "over"
    assert b"haptic" not in board_path(folder, "p01").read_bytes()


def test_a_rehearsal_in_a_plan_of_people_and_people_in_one_of_rehearsals_are_refused(tmp_path: Path) -> None:
    people, rehearsals = study(tmp_path / "a", simulated=False), study(tmp_path / "b")
    with pytest.raises(InvalidValueError, match="simulated sessions do not belong into a plan of people"):
        lead_session(people, "p01", StandingBench(), Experimenter())
    assert not events_path(people, "p01").exists()
    with pytest.raises(InvalidValueError, match="people in it would pass for simulated"):
        resume(rehearsals, read_plan(rehearsals), "p01", t_ns=0, where="lab")
    assert not events_path(rehearsals, "p01").exists()
    for folder, where in ((people, "lab"), (rehearsals, "emulated"), (rehearsals, "simulated")):
        journal, _state = resume(folder, read_plan(folder), "p01", t_ns=0, where=where)  # type: ignore[arg-type]
        journal.close()
        assert events_of(folder)[-1].item == where
    assert not rehearsed(events_of(people))
    assert rehearsed(events_of(rehearsals))


@pytest.mark.parametrize(
    ("key", "at_s", "ends"),
    [(ENTER, 0.5, False), (ENTER, 5.0, False), ("e", 0.5, False), ("x", 0.9, False), ("e", 1.5, True), ("x", 1.5, True),
     ("z", 0.1, True), ("a", 0.1, True)],
)  # fmt: skip
def test_the_key_that_begins_a_trial_does_not_end_it_and_its_first_second_is_quiet(
    key: str, at_s: float, ends: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = study(tmp_path)
    with Journal(events_path(folder, "p01")) as journal:
        led = trial_led(folder, journal, StandingBench(own_time=True))
        until(lambda: (led.step([]), led.phase == "trial")[1])
        monkeypatch.setattr(led.going, "elapsed_s", lambda: at_s)
        assert led.step([key]) == ends
        led.break_off("the test is over")
    assert [event.kind for event in events_of(folder)][-1] == "trial_end"


def test_a_trial_ends_although_the_disk_is_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = study(tmp_path)
    with Journal(events_path(folder, "p01")) as journal:
        led = trial_led(folder, journal, StandingBench())
        until(lambda: led.going.started_ns is not None or led.step([]))
        monkeypatch.setattr(journal, "add", lambda *_, **__: (_ for _ in ()).throw(OSError("full")))
        with pytest.raises(OSError, match="full"):
            led.break_off("Ctrl-C")
        assert led.going.over()


@pytest.mark.slow
@pytest.mark.parametrize("last", [False, True])
def test_a_trial_is_done_again_and_only_the_second_attempt_counts(*, last: bool, tmp_path: Path) -> None:
    """The first of a block, or the last of the session; the report says which, and why."""
    folder = study(tmp_path, trials=2)
    desk = _Repeating(after=4 if last else 1)
    state = lead_session(folder, "p01", LiftingBench(), desk, time_scale=0.001)
    assert state.next is None
    ran = [(e.trial, e.attempt) for e in events_of(folder) if e.kind == "trial_start"]
    block = [trial.trial for trial in read_plan(folder).of("p01") if trial.block == 1]
    rest = [(k, 1) for k in (1, 2, 3, 4) if k not in block]
    first = [(k, 1) for k in block]
    assert ran == ([*first, *rest, (4, 2)] if last else [*first, (1, 2), *rest])
    number, why = 4 if last else 1, "the gel came off"
    redone = [(e.trial, e.attempt, e.text) for e in events_of(folder) if e.kind == "redo"]
    assert redone == [(number, 1, why)]
    # The slip that was keyed in each attempt is counted once.
    trials = study_trials(folder)[1]
    assert [trial.status for trial in trials] == ["done"] * 4
    assert [trial.redone for trial in trials] == [why * (k == number) for k in (1, 2, 3, 4)]
    assert [trial.slips + trial.slips_before for trial in trials] == [1] * 4
    analysis, _ = analyse_study(folder)
    ((name, reported),) = analysis.flow.redone.items()
    assert (name, reported) == (trials[number - 1].id, why)
    assert f"done again, and their first attempts do not count: {name}: {why}." in report_html(analysis, {})


@pytest.mark.parametrize("auto", [False, True])
def test_what_begins_by_itself_after_a_trial_needs_somebody_who_leads(*, auto: bool, tmp_path: Path) -> None:
    folder = study(tmp_path, trials=2)
    end = RestTaskEnd("it is at its start")

    class Moving(LiftingBench):
        rest_tasks: Any = (RestTask("h", "to its start", "note", lambda _running: end, after_trials=True),)

    desk = Experimenter()
    with pytest.raises(InvalidValueError, match="pedal 'h': begins to its start in a rest"):
        lead_session(folder, "p01", Moving(), desk, pedals="1h")
    assert not events_path(folder, "p01").exists()
    lead_session(folder, "p01", Moving(), desk, time_scale=0.001, auto=auto)
    noted = [event.trial for event in events_of(folder) if event.text == "it is at its start"]
    assert noted == ([] if auto else [1, 2, 3]), "after each trial that another one follows"
    assert desk.said.count("to its start: it is at its start") == len(noted)


class _Feet(ScriptedDesk):
    """Leads by pedals alone, and types no more than why a trial is done again."""

    def __init__(self) -> None:
        super().__init__(rating="i", answer="the gel came off")
        self._ready, self._marks, self._heading = list("15111"), iter(""), ""

    def observe(self, screen: Screen) -> None:
        if screen.phase == "ready" and (screen.phase, screen.heading) != (self.phase, self._heading):
            self.waiting.append(self._ready.pop(0))
        elif screen.phase == "trial":  # its result cannot be keyed in the first second
            self._marks = self._marks if self.phase == "trial" else iter("1344")
            self.waiting.append(next(self._marks, "2"))
        self._heading = screen.heading


@pytest.mark.slow
def test_pedals_begin_mark_score_end_and_repeat_trials(tmp_path: Path) -> None:
    folder = study(tmp_path)
    state = lead_session(folder, "p01", StandingBench(), _Feet(), time_scale=0.001, pedals="12345")
    assert state.next is None
    events = events_of(folder)
    assert [(e.trial, e.attempt) for e in events if e.kind == "trial_start"] == [(1, 1), (1, 2), (2, 1)]
    assert [e.text for e in events if e.kind == "redo"] == ["the gel came off"]
    for trial, attempt in ((1, 1), (1, 2), (2, 1)):
        own = [e for e in events if (e.trial, e.attempt) == (trial, attempt)]
        keyed = [e.kind for e in own if e.source == "experimenter" and e.kind != "redo"]
        assert keyed == ["lift_off", "slip", "deformation", "deformation"]
        (end,) = [e for e in own if e.kind == "trial_end"]
        assert end.text == "ended by the experimenter"


def test_pedals_that_mean_something_else_and_conditions_that_cannot_be_applied_begin_no_session(
    tmp_path: Path,
) -> None:
    pytest.importorskip("mujoco")
    folder = study(tmp_path, conditions=["haptic", "unfelt"])
    for bench in (StandingBench(), SimulatedBench(read_plan(folder), "p01", real_time=False)):
        with pytest.raises(InvalidValueError, match="'unfelt' cannot be run"):
            lead_session(folder, "p01", bench, Experimenter())
    assert not events_path(folder, "p01").exists()
    folder = study(tmp_path / "other")
    for pedals in ("11", "123456", "1s", "e", "1 ", "q", "r1", "\r"):
        with pytest.raises(InvalidValueError, match="one to five keys that mean nothing else"):
            lead_session(folder, "p01", StandingBench(), Experimenter(), pedals=pedals)
    assert not events_path(folder, "p01").exists()


class _Repeating(Experimenter):
    """Keys a slip in each trial, and wants one again."""

    def __init__(self, after: int) -> None:
        super().__init__({"trial": "s"}, answer="the gel came off")
        self._after = after

    def show(self, screen: Screen) -> None:
        if screen.phase != "ready" or self.phases.count("trial") != self._after:
            super().show(screen)
        else:
            self._after = -1
            self.waiting.append("r")


def test_a_trial_that_was_to_be_done_again_and_was_not_is_no_data(tmp_path: Path) -> None:
    folder = study(tmp_path, trials=2)
    lead_session(folder, "p01", LiftingBench(), _Repeating(after=9), time_scale=0.001, trials=2)
    with Journal(events_path(folder, "p01")) as journal:
        journal.add("redo", t_ns=journal.events[-1].t_ns, trial=1, text="the gel came off")
        assert derive(read_plan(folder).of("p01"), journal.events).next == (1, 2)
        (first, second) = study_trials(folder)[1]
        assert (first.counts, second.counts) == (False, True)
        export(folder, tmp_path / "open", key="secret")
        assert study_trials(tmp_path / "open")[1][0].redone, "a reason that is left out is one all the same"
        journal.add("undo", t_ns=journal.events[-1].t_ns, trial=1, undone=journal.events[-1].n)
    assert all(trial.counts and not trial.redone for trial in study_trials(folder)[1])


@pytest.mark.parametrize(("alone", "stops"), [(False, True), (True, False)])
def test_a_standard_input_that_has_ended_stops_a_session_unless_nobody_needs_to_be_there(
    monkeypatch: pytest.MonkeyPatch, *, alone: bool, stops: bool
) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO("y\n"))
    received, ends = list[str](), pytest.raises(KeyboardInterrupt) if stops else nullcontext()
    with ends, LineDesk(alone=alone) as desk:
        for _ in range(20):
            received += desk.keys()
            time.sleep(0.01)
    assert received == ["y"]
