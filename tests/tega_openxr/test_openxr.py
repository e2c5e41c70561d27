"""The OpenXR source against an emulated runtime that OpenXR's own loader loads, with its poses in another process."""

from __future__ import annotations

import json
import math
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from reference import processes
from reference.trackers import Steered, some, until
from tega.errors import DeviceUnavailableError
from tega_emulators.openxr_runtime import openxr_runtime, why_no_runtime
from tega_emulators.process import Emulator
from tega_openxr.session import OpenXrOptions
from tega_openxr.tracker import OpenXr

pytestmark = pytest.mark.slow

xr = pytest.importorskip("xr", reason="needs pyopenxr: pip install 'tega[openxr]'")


@pytest.fixture
def service() -> Iterator[Emulator]:
    if reason := why_no_runtime():
        pytest.skip(reason)
    with openxr_runtime() as emulator:
        yield emulator


def opened(**options: object) -> OpenXr:
    # However busy the machine is: a session that takes its time is no failure.
    return OpenXr(OpenXrOptions(**{"connect_s": 60.0, **options}))  # type: ignore[arg-type]


AT = (0.31, -0.22, -0.53)


@pytest.mark.parametrize(
    ("options", "moved_m"),
    [
        ({}, (0, 0, 0)),
        ({"source": "aim"}, (0, 0, -0.05)),
        ({"source": "wrist"}, (0, 0, 0.1)),
        ({"source": "tracker"}, (0, 0, 0)),
        ({"source": "wrist", "hand": "left"}, (-0.4, 0, 0.1)),
        ({"hand": "left", "base": "stage"}, (-0.4, 1.6, 0)),
    ],
)
def test_poses_are_those_of_the_path_at_their_times(
    service: Emulator, options: dict[str, object], moved_m: tuple[float, float, float]
) -> None:
    service.say(f"at {AT[0]} {AT[1]} {AT[2]}")
    service.say("turn 0 0.6 0 0.8")
    service.say("wave 0.3 0.5")
    with opened(**options) as tracker:
        poses = some(tracker)
        until(tracker, lambda _: tracker.problem == "")
        assert "TEGA's emulated runtime 1.0.0" in tracker.info.label
    for pose in poses:
        forward_m = 0.3 * math.sin(math.pi * pose.t_ns / 1e9)
        place = [a + m for a, m in zip(AT, moved_m, strict=True)]
        # It trembles by 0.2 mm, and OpenXR's numbers have 24 bits.
        assert pose.position_m == pytest.approx([place[0], place[1], place[2] - forward_m], abs=2e-3)
        assert pose.quaternion_xyzw == pytest.approx((0, 0.6, 0, 0.8), abs=1e-6)


def test_a_runtime_that_converts_no_times_gives_poses_and_says_so(service: Emulator) -> None:
    service.say("without XR_KHR_convert_timespec_time")
    service.say(f"at {AT[0]} {AT[1]} {AT[2]}")
    with opened() as tracker:
        for pose in some(tracker):
            assert pose.position_m == pytest.approx(AT, abs=2e-3)
            assert pose.t_ns <= time.monotonic_ns()
        assert any("does not convert its clock" in note for note in tracker.info.notes)


def test_what_is_only_guessed_or_not_seen_is_not_believed(service: Emulator) -> None:
    with opened() as tracker:
        some(tracker)
        service.say("lose")
        # The guess drifts away, and is passed on as one.
        lost = some(tracker, valid=False)
        assert lost[-1].position_m[1] < lost[0].position_m[1]
        service.say("find")
        some(tracker)
        assert tracker.counts.guessed >= 10
        for fault in ("no-place", "nowhere"):
            service.say(fault)
            some(tracker, valid=False)
            service.say("clear")
            some(tracker)
        assert tracker.counts.lost >= 10
        assert any("not seen" in note for note in tracker.info.notes)


def test_a_pose_that_is_not_new_is_none(service: Emulator) -> None:
    with opened() as tracker:
        some(tracker)
        service.say("same")
        until(tracker, lambda _: tracker.counts.repeated > 5)
        tracker.read(0)
        repeated = tracker.counts.repeated
        assert until(tracker, lambda _: tracker.counts.repeated > repeated + 5) == []


def test_a_service_that_goes_is_told_and_found_again_and_the_arm_stays(service: Emulator) -> None:
    with opened() as tracker:
        steered = Steered(tracker)
        steered.hold()
        before = steered.at
        service.say("hide")
        steered.until(lambda c: c.state != "following")
        steered.until(lambda _: "connecting again" in tracker.problem)
        # When it is back its origin is elsewhere by less than what the gate calls a jump.
        service.say("recentre 0.05 0 0")
        service.say("show")
        steered.until(lambda _: tracker.counts.connections == 2 and tracker.problem == "")
        steered.until(lambda c: c.reason.endswith("let the clutch go and press it again"))
        assert steered.travel_m(before) < 0.005
        steered.hold()
        assert any("was restarted" in note for note in tracker.info.notes)


def test_an_origin_that_is_moved_lets_the_arm_go(service: Emulator) -> None:
    with opened() as tracker:
        steered = Steered(tracker)
        steered.hold()
        before = steered.at
        service.say("recentre 0.05 0 0")
        command = steered.until(lambda c: c.state == "idle")
        assert command.reason.endswith("let the clutch go and press it again")
        assert steered.travel_m(before) < 0.005
        assert tracker.counts.recentred == 1
        steered.hold()


@pytest.mark.parametrize("source", ["grip", "wrist"])
def test_states_of_the_session_are_told_in_words(service: Emulator, source: str) -> None:
    with opened(source=source) as tracker:
        some(tracker)
        # A session that is to stop is ended, and then idle.
        for state, words in (("visible", "has the focus"), ("stopping", "keeps the session idle")):
            service.say(f"state {state}")
            until(tracker, lambda _, w=words: w in tracker.problem)  # type: ignore[misc]
            tracker.read(0)
            received_ns = {tracker._received_ns}
            assert until(tracker, lambda _, h=received_ns: h.add(tracker._received_ns) or len(h) > 5) == []  # type: ignore[misc]
            service.say("state ready" if state == "stopping" else "state focused")
            # Whoever steers takes hold anew.
            until(tracker, lambda poses: bool(poses) and not poses[0].valid)
            some(tracker)
            until(tracker, lambda _: tracker.problem == "")
        assert tracker.counts.connections == 1


@pytest.mark.parametrize(
    ("event", "text"),
    [
        ("state exiting", "TEGA's emulated runtime 1.0.0 has ended the session"),
        ("state loss-pending", "TEGA's emulated runtime 1.0.0 is gone"),
        ("instance-loss", "TEGA's emulated runtime 1.0.0 says that it ends"),
        ("", "unexpected ValueError: 77 is not a valid SessionState"),
    ],
)
def test_a_session_that_is_over_is_made_anew(
    service: Emulator, event: str, text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    newer, odd, poll = xr.EventDataBuffer(), xr.EventDataSessionStateChanged(), xr.poll_event
    newer._type, odd._state = 999_999, 77  # an event and a state that this library does not know
    unknown = [] if event else [odd, newer]
    with opened() as tracker:
        some(tracker)
        monkeypatch.setattr(xr, "poll_event", lambda instance: unknown.pop() if unknown else poll(instance))
        if event:
            service.say(event)
        until(tracker, lambda _: tracker.counts.connections == 2)
        some(tracker)
        until(tracker, lambda _: tracker.problem == "")
        assert f"restarted 1 times; last reason: {text}" in tracker.info.notes[-1]


def test_a_headset_that_sleeps_keeps_the_session_from_beginning(service: Emulator) -> None:
    service.say("asleep")
    text = r"no session after 0\.5 s: .*(idle|does not answer|begun)"
    with pytest.raises(DeviceUnavailableError, match=text):
        opened(connect_s=0.5).open()
    service.say("awake")
    with opened() as tracker:
        some(tracker)


def test_a_controller_that_is_off_and_a_service_that_does_not_answer_are_told(service: Emulator) -> None:
    service.say("off")
    with opened() as tracker:
        some(tracker, valid=False)
        off = "openxr: the runtime has no right controller: is it switched on?"
        until(tracker, lambda _: tracker.problem == off)
        service.say("on")
        some(tracker)
        until(tracker, lambda _: tracker.problem == "")
        assert "the runtime calls it khr/simple_controller" in tracker.info.notes
        service.say("freeze")
        until(tracker, lambda _: "has not answered for" in tracker.problem)
        service.say("clear")
        some(tracker)
        until(tracker, lambda _: tracker.problem == "")


def test_a_runtime_that_never_brings_the_session_into_focus_is_told(service: Emulator) -> None:
    service.say("stuck")
    text = "not brought it into focus; one that never does is too old"
    with opened() as tracker:
        until(tracker, lambda _: text in tracker.problem)
        assert tracker.read(0) == []


def test_it_leaves_as_a_runtime_wants_it_and_no_thread_is_left(service: Emulator) -> None:
    tracker = opened()
    for _ in range(2):
        with tracker:
            some(tracker)
        assert [t.name for t in threading.enumerate() if t.name == "tega-openxr"] == []
    processes.until(lambda: service.say("look")["clients"] == 0)  # it hears of the end in its own time
    assert service.say("look")["asked"] == ["session", "begin", "end"] * 2
    with pytest.raises(DeviceUnavailableError, match="not open"):
        tracker.read(0)


def test_its_calls_are_what_openxr_s_own_validation_layer_allows(
    service: Emulator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    layer = "XR_APILAYER_LUNARG_core_validation"
    if layer not in {p.layer_name.decode() for p in xr.enumerate_api_layer_properties()}:
        pytest.skip(f"pyopenxr brings no {layer} for this machine")
    log = tmp_path / "validation.txt"
    monkeypatch.setenv("XR_ENABLE_API_LAYERS", layer)
    monkeypatch.setenv("XR_CORE_VALIDATION_EXPORT_TYPE", "text")
    monkeypatch.setenv("XR_CORE_VALIDATION_FILE_NAME", str(log))
    for source in ("grip", "wrist", "tracker"):
        with opened(source=source) as tracker:
            some(tracker)
            if source == "grip":
                service.say("state exiting")
                until(tracker, lambda _, t=tracker: t.counts.connections == 2)  # type: ignore[misc]
                some(tracker)
    text = log.read_text()
    assert text.count("is initialized") == 4
    assert "VALID_ERROR" not in text
    assert "VALID_WARNING" not in text
    # What is not allowed, the layer says.
    instance = xr.create_instance()
    with pytest.raises(xr.ValidationFailureError):
        xr.string_to_path(instance, None)
    xr.destroy_instance(instance)
    assert "VALID_ERROR" in log.read_text()


@pytest.mark.parametrize(
    ("lacking", "options", "text"),
    [
        ("XR_MND_headless", {}, "emulated runtime 1.0.0 has no sessions without a picture"),
        ("XR_EXT_hand_tracking", {"source": "wrist"}, "knows no source = 'wrist'"),
        ("XR_HTCX_vive_tracker_interaction", {"source": "tracker"}, "knows no source = 'tracker'"),
    ],
)
def test_what_a_runtime_cannot_do_is_said(
    service: Emulator, lacking: str, options: dict[str, object], text: str
) -> None:
    service.say(f"without {lacking}")
    with pytest.raises(DeviceUnavailableError, match=text):
        opened(**options).open()
    service.say("without")
    with opened(**options) as tracker:
        some(tracker)
        with pytest.raises(DeviceUnavailableError, match="can only once"):
            opened().open()


def test_without_a_runtime_it_is_said_where_one_is_looked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    runtime = {"library_path": str(tmp_path / "nothing.so")}
    (tmp_path / "there.json").write_text(json.dumps({"file_format_version": "1.0.0", "runtime": runtime}))
    for file, text in (
        ("none.json", r"XR_RUNTIME_JSON names .*none\.json, which does not exist"),
        ("there.json", "which does not load"),
        ("", r"no OpenXR runtime: .*(Monado|active_runtime)"),
    ):
        monkeypatch.setenv("XR_RUNTIME_JSON", str(tmp_path / file) if file else "")
        with pytest.raises(DeviceUnavailableError, match=text):
            opened().open()
    assert [t.name for t in threading.enumerate() if t.name == "tega-openxr"] == []
