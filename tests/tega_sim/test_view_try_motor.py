"""A click on the page's torso: one motor, while the run is armed, within the limits, for who has the token."""

from __future__ import annotations

import threading
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from reference.moments import Moments
from reference.processes import until
from reference.sessions import tree
from tega.config import check_tree
from tega.haptics import MotorLevels, vest_frame
from tega.loop import run_session
from tega.loop.controls import TEST_PERCENT, Controls, MotorAnswer, MotorTests
from tega.recording.replay import replay_file
from tega.records import RunState, TriedMotor, VestFrame
from tega.records.bus import Bus
from tega.safety.motor_budget import MotorBudget

SILENCE = vest_frame([0] * 4, [0] * 4, layout="x40")


class Loop:
    """Ticks as the loop does, with a vest whose limits are those of a real one, until the block is left."""

    def __init__(self, why: str = "", *, limit: int = 100, vest: bool = True, spent: bool = False) -> None:
        self.why, self.vest, self.bus, self.tests = why, vest, Bus(), MotorTests()
        self.tests.begin(lambda: self.why, self.bus)
        self.budget = MotorBudget(limit=limit)
        if spent:
            self.budget.carry(dose_s=np.full(40, 10_000.0), heat=np.zeros(40))
        self.frames: list[MotorLevels] = []
        self.reported: list[TriedMotor] = []
        self.bus.subscribe(TriedMotor, self.reported.append)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def _run(self) -> None:
        t_ns = 0
        while not self._over.wait(0.002):
            self.tick(t_ns)
            t_ns += 33_000_000

    def tick(self, t_ns: int) -> None:
        frame = self.tests.frame(t_ns, SILENCE)
        self.frames.append(frame)
        allowed = self.budget.allow(t_ns, frame.x40())
        self.tests.sent(t_ns, MotorLevels("x40", allowed) if self.vest else None)

    def __enter__(self) -> Loop:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()


def test_one_motor_vibrates_for_half_a_second_and_is_told_of() -> None:
    with Loop() as loop:
        answer = loop.tests.ask(7)
        assert answer == MotorAnswer(done=True, words=f"motor 7 vibrates at {TEST_PERCENT} %")
        until(lambda: len(loop.reported) == 2)
    lit = [frame for frame in loop.frames if frame.intensities.any()]
    assert {tuple(np.flatnonzero(frame.intensities).tolist()) for frame in lit} == {(7,)}
    assert 15 <= len(lit) <= 17
    assert [(one.motor, one.percent) for one in loop.reported] == [(7, TEST_PERCENT), (7, 0)]


@pytest.mark.parametrize(
    ("loop", "motor", "text"),
    [
        (lambda: Loop("the run is active"), 7, "not tried: the run is active"),
        (Loop, 40, "not tried: motor 40 is none of 0 to 39 of x40"),
        (lambda: Loop(vest=False), 7, "not tried: the run has no vest"),
        (lambda: Loop(spent=True), 7, "its limits allow it no more"),
    ],
    ids=["not armed", "no such motor", "no vest", "the day's dose is used up"],
)
def test_it_is_refused_with_the_reason(loop: Callable[[], Loop], motor: int, text: str) -> None:
    with loop() as running:
        answer = running.tests.ask(motor)
    assert not answer.done
    assert text in answer.words
    assert running.tests._running is None


def test_a_limit_lowers_it_and_it_counts_to_the_dose() -> None:
    with Loop(limit=20) as loop:
        assert loop.tests.ask(3).words == "motor 3 vibrates at 20 %"
        until(lambda: len(loop.reported) == 2)
    assert loop.budget.dose_s[3] == pytest.approx(0.2**2 * 0.5, rel=0.2)
    assert not np.delete(loop.budget.dose_s, 3).any()


def test_it_ends_with_the_armed_state_and_one_is_tried_at_a_time() -> None:
    loop = Loop()
    answers: list[MotorAnswer] = []
    asking = threading.Thread(target=lambda: answers.append(loop.tests.ask(1)))
    asking.start()
    until(lambda: loop.tests._wanted == 1)
    assert loop.tests.ask(2).words == "not tried: another motor is"
    loop.tick(0)
    asking.join()
    assert answers[0].done
    loop.why = "the run is active"
    loop.tick(33_000_000)
    assert not loop.frames[-1].intensities.any()
    assert loop.reported[-1].percent == 0


def test_a_run_that_does_not_tick_answers_all_the_same() -> None:
    assert MotorTests().ask(0) == MotorAnswer(done=False, words="not tried: the run drives no vest now")


def test_a_run_hears_it_while_armed_and_its_recording_is_computed_again_with_it(tmp_path: Path) -> None:
    pytest.importorskip("foxglove", reason="needs the extra record")
    settings = check_tree(tree(tmp_path / "session"), {}, base=Path.cwd()).config
    tests, bus, states, lit = MotorTests(), Bus(), [], []
    bus.subscribe(RunState, lambda state: states.append(state.state))
    bus.subscribe(VestFrame, lambda frame: lit.append((states[-1], frame.intensities)))
    going: list[int] = []

    def go() -> bool:
        going.append(1)
        if len(going) == 2:
            tests._wanted = 5
        return len(going) > 5

    # A run on recordings has no vest that could be sent anything.
    tests.sent = lambda _t_ns, _sent: None  # type: ignore[method-assign, assignment]
    summary = run_session(settings, bus=bus, controls=Controls(go=go, motor_tests=tests))
    armed = [frame for state, frame in lit if state == "armed" and any(frame)]
    assert armed
    assert all(frame[5] == TEST_PERCENT and sum(frame) == TEST_PERCENT for frame in armed)
    replay = replay_file(tmp_path / "session" / summary["recording"]["file"])
    assert replay.same


def get(url: str, **headers: str) -> tuple[int, str]:
    try:
        with urllib.request.urlopen(urllib.request.Request(url, headers=headers)) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode()


def test_only_a_page_of_this_server_is_heard() -> None:
    pytest.importorskip("viser", reason="needs the extra view")
    from tega.ui.view.browser import BrowserView, Controls

    requested: list[int] = []

    def ask(motor: int) -> MotorAnswer:
        requested.append(motor)
        return MotorAnswer(done=motor == 7, words=f"about {motor}")

    with BrowserView("a run", port=0, controls=Controls(try_motor=ask)) as view:
        base = view.url.removesuffix("/").rpartition("/")[0]
        assert get(f"{view.url}try/7") == (200, "about 7\n")
        assert get(f"{view.url}try/8") == (409, "about 8\n")
        assert get(f"{base}/try/7")[0] == 403
        assert get(f"{base}/wrong-token/try/7")[0] == 403
        status, text = get(f"{view.url}try/7", Origin="http://elsewhere.example")
        assert (status, "another site's page" in text) == (403, True)
        view.offer(Moments().at(2.0, images=False, scene=False, emg=False))
        until(lambda: "try/39" in view.page._vest.content)
    assert requested == [7, 8]
