# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""``--view``: sessions and replays on the page, pauses and muting, and a click on the torso that tries a motor."""

from __future__ import annotations

import json
import sys
import threading
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.command import call
from reference.moments import Moments, completed
from reference.parts import observed
from reference.processes import until
from reference.recordings import write_folder
from reference.scripted import ScriptedCamera, live_frame, touching
from reference.sessions import tree
from tega.config import check_tree
from tega.config.calibration import Calibration
from tega.errors import MissingExtraError
from tega.haptics import MotorLevels, vest_frame
from tega.loop import run_session
from tega.loop.controls import TEST_PERCENT, Controls, MotorAnswer, MotorTests
from tega.loop.inbox.inputs import Finger, Prepared
from tega.loop.inbox.sources import SourceReport, picture_of
from tega.loop.inbox.stream import PulledStream
from tega.loop.snapshot import LoopView
from tega.recording.replay import replay_file
from tega.records import RunState, TriedMotor, VestFrame
from tega.records.bus import Bus
from tega.safety.motor_budget import MotorBudget
from tega.ui.view.browser import BrowserView
from tega.ui.view.browser import Controls as PageControls
from tega.ui.view.browser.feed import SessionFeed
from tega.ui.view.state import ViewState

SECONDS = 3.0
SILENCE = vest_frame([0] * 4, [0] * 4, layout="x40")


def given(**session) -> dict[str, Any]:
    touch = {"driver": "synthetic-touch", "options": {"seed": 1, "duration_s": SECONDS}}
    emg = {"driver": "synthetic-emg", "kind": "raw", "options": {"seed": 1, "duration_s": SECONDS}}
    return {"session": {"pace": "fast", **session}, "tactile": {"thumb": touch, "ring": touch}, "emg": emg}


def test_a_sessions_moments_are_completed_with_pictures_signal_and_hand_and_looking_changes_nothing(tmp_path):
    run_session(check_tree(given(out_dir="plain"), {}, base=tmp_path).config)
    done: list[Any] = completed(given(out_dir="seen"), tmp_path)
    assert len(done) == round(30 * SECONDS) + 1
    assert [state.loop.state for state in done[-2:]] == ["active", "stopped"]
    state = done[45]
    assert set(state.images) == {"thumb", "ring"}
    assert state.images["thumb"].frame.shape == (320, 240, 3)
    assert len(state.emg.samples) == 1500
    assert state.emg.rate_hz == 1000
    assert state.poses.shape == (len(state.shapes), 7)
    assert set(state.rows) == {"preset", "fatigue"}
    assert state.rows["preset"] == "live"
    assert state.rows["fatigue"].startswith("median frequency ")
    assert 0 <= state.latency_ms["picture to vest"] < 1000 / 60
    # The picture is the one that was measured last, and map and outline are those of the metric that did.
    n_touched = 0
    for state in done[1::5]:
        image, contact = state.images["thumb"], state.loop.contacts["thumb"]
        assert (image.contact.t_ns, image.contact.eda) == (contact.t_ns, contact.eda)
        assert image.map.unit == "mm"
        assert np.count_nonzero(image.map.mask) == contact.eda
        assert (image.map.height.max() > 0) == contact.in_contact
        n_touched += contact.in_contact
    assert 3 < n_touched < len(done[1::5])
    for name in ("contacts.csv", "levels.csv", "vest.csv", "can.csv", "summary.json"):
        assert (tmp_path / "plain" / name).read_bytes() == (tmp_path / "seen" / name).read_bytes()


def test_a_muted_vest_rests(tmp_path):
    frames: list[Any] = []
    run_session(
        check_tree(given(), {}, base=tmp_path).config,
        controls=Controls(haptics=lambda: len(frames) < 45),
        bus=observed(lambda loop: frames.append(loop.vest)),
    )
    received = [int(frame.intensities.max()) for frame in frames]
    assert max(received[:45]) > 50
    assert max(received[45:]) == 0


def test_run_with_view_says_where_and_prints_the_summary(tmp_path, capsys):
    config = tmp_path / "session.toml"
    config.write_text(
        '[session]\npace = "fast"\n[emg]\ndriver = "synthetic-emg"\nkind = "raw"\noptions = {duration_s = 3.0}\n'
    )
    out, err = call(capsys, "run", config, "--view", "--view-port", "0", "--json")
    assert err.splitlines()[1].startswith("http://127.0.0.1:")
    assert err.splitlines()[-1] == err.splitlines()[1]
    assert json.loads(out)["ended"] == "complete"


def test_without_viser_the_extra_is_named(monkeypatch):
    for name in [name for name in sys.modules if name.split(".")[0] == "viser"] + ["viser"]:
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.delitem(sys.modules, "tega.ui.view.browser.local", raising=False)
    with pytest.raises(MissingExtraError, match=r"pip install 'tega\[view\]'"):
        BrowserView(port=0).__enter__()


def test_a_live_sensor_is_looked_at_as_its_frames_pass():
    frames = [live_frame(k) for k in range(3)]
    camera: Any = ScriptedCamera(frames)
    # Measured at another station: pictures come alone, contacts with the loop's moments.
    finger = Finger(camera, frames[0].image, "given", SourceReport(), stream=PulledStream(iter(())))
    bus = Bus()
    feed = SessionFeed({}, bus)
    feed.prepared(Prepared({"thumb": finger}, None, Calibration(preset="live", origin=""), ""))
    loop = LoopView(0, {"thumb": touching(eda=90)}, None, None, None, {})
    assert feed.complete(ViewState(0, loop)).images == {}
    for frame in frames:
        bus.publish(picture_of("thumb", frame, received_ns=frame.t_ns))
        images = feed.complete(ViewState(0, loop)).images
        assert images is not None
        assert images["thumb"].frame is frame.image
        assert images["thumb"].contact.eda == 90


def test_replay_with_view_keeps_time_and_takes_in_the_same(tmp_path, capsys):
    write_folder(tmp_path / "presses", 30)
    tables = {}
    for out, more in (("plain", []), ("seen", ["--view", "--view-port", "0"])):
        words = "replay", "--tactile", f"thumb={tmp_path / 'presses'}", "--out", tmp_path / out, "--json"
        printed, _ = call(capsys, *words, *more)
        measured = json.loads(printed)["measured"]
        tables[out] = [(tmp_path / out / name).read_bytes() for name in ("contacts.csv", "calibration.toml")]
    assert tables["plain"] == tables["seen"]
    assert measured["wall_s"] > 0.5  # 30 frames at 60 Hz: it waited for the clock


def test_a_page_that_paints_nothing_fills_no_memory(tmp_path):
    """What is heard is trimmed as it comes, not as it is painted: a page may fail, or nobody may look."""
    emg = {"driver": "synthetic-emg", "kind": "raw", "options": {"seed": 1, "duration_s": 24.0}}
    tree = {"session": {"pace": "fast", "duration_s": 24.0}, "emg": emg}
    bus = Bus()
    feed = SessionFeed({}, bus)
    run_session(check_tree(tree, {}, base=tmp_path).config, bus=bus, parts=[feed])
    kept_s = sum(len(chunk.samples) // chunk.n_channels for chunk in feed._chunks) / 1000
    assert 1 < kept_s < 16


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
    # A run that does not tick answers all the same.
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
    requested: list[int] = []

    def ask(motor: int) -> MotorAnswer:
        requested.append(motor)
        return MotorAnswer(done=motor == 7, words=f"about {motor}")

    with BrowserView("a run", port=0, controls=PageControls(try_motor=ask)) as view:
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
