"""Runs look at hand and arm for slips, on emulated devices and on the bench, and are computed again alike."""

from __future__ import annotations

import csv
import sys
from pathlib import Path
from typing import Any

import pytest

from reference.parts import Running
from reference.processes import until
from reference.sessions import read_recorded
from tega.config import check_tree
from tega.recording.replay import replay_file
from tega.recording.replay.play import play_file
from tega.recording.trim import trim_session
from tega.records import Event, HandLook, VestFrame
from tega.records.bus import Bus
from tega_emulators.lab import emulated_lab

pytestmark = [pytest.mark.slow, pytest.mark.skipif(sys.platform == "win32", reason="needs Linux or macOS")]
pytest.importorskip("foxglove", reason="comes with the extra record")


def test_a_run_looks_at_hand_and_arm_and_goes_by_touch_while_the_hand_is_silent(tmp_path: Path) -> None:
    with emulated_lab(tmp_path, arm=True, hand=True, emg_hz=250.0, vest=True, fingers=("index",)) as lab:
        lab.tree["stages"] = {"mapping": {"name": "pulses"}}
        lab.tree["recording"] = {"dir": str(tmp_path / "recorded"), "lossless": True}
        lab.tree["hand"]["options"] |= {"silent_after_ms": 300.0, "reconnects": 5}
        with Running(check_tree(lab.tree, {}, base=tmp_path).config) as run:
            until(lambda: run.view.t_ns > 1e9)
            lab.hand.say("power-cycle")
            until(lambda: run.view.t_ns > 5e9)
            summary = run.end()
    file = tmp_path / "recorded" / summary["recording"]["file"]
    looks = read_recorded(file, HandLook).of(HandLook)
    whole = [check.closure is not None for check in looks]
    turns = [now for n, now in enumerate(whole) if n == 0 or whole[n - 1] != now]
    assert turns[-3:] == [True, False, True], turns
    for one in looks:
        if one.closure is not None:
            assert one.height_m is not None
            assert one.level is not None
            assert 0 < one.height_m < 1
            assert 1 <= one.closure <= 5
            assert len(one.tips_mm) == 4
        assert one.seen_ns >= one.t_ns
    replay = replay_file(file)
    assert replay.same, [stream for stream in replay.streams if stream.differ]


_PLAN: dict[str, Any] = {
    "object": "bag",
    "mass_kg": 1.2,
    "friction": 0.7,
    "condition": "event-gated",
    "seed": 9111,
}


@pytest.fixture(scope="module")
def lift(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Any, Path]]:
    pytest.importorskip("mujoco", reason="needs the extra tega[sim]")
    from tega_sim.streams import LiftRecorder
    from tega_sim.trial import TrialPlan, run_trial

    lifts = {}
    # Trials go by touch unless their settings say so.
    for rule, settings in (("touch", ()), ("hand", ("stages.slips=hand",))):
        folder = tmp_path_factory.mktemp(f"by-{rule}")
        plan = TrialPlan(**_PLAN, settings=settings)
        result = run_trial(plan, recorder=LiftRecorder(folder / "recorded", real_time=False))
        (file,) = (folder / "recorded").glob("*.mcap")
        lifts[rule] = result, file
    return lifts


def _slips_s(file: Path) -> list[float]:
    return [one.taken_ns / 1e9 for one in read_recorded(file, Event).of(Event) if one.kind == "slip"]


def test_joints_and_height_tell_a_slide_where_touch_does_not(lift: dict[str, tuple[Any, Path]]) -> None:
    result, file = lift["hand"]
    slid_s = [event.t_s for event in result.events if event.kind == "slip"]
    reported_s = _slips_s(file)
    assert len(slid_s) == len(reported_s) == 1
    assert all(0 <= reported - slid < 0.1 for slid, reported in zip(slid_s, reported_s, strict=True))
    result, file = lift["touch"]
    slid_s = [event.t_s for event in result.events if event.kind == "slip"]
    assert len(slid_s) > 0
    assert _slips_s(file) == []


def test_a_recording_replays_by_its_own_rule(lift: dict[str, tuple[Any, Path]], tmp_path: Path) -> None:
    for rule, (_, file) in lift.items():
        replay = replay_file(file)
        assert replay.same, (rule, [stream for stream in replay.streams if stream.differ])
        (events,) = (stream for stream in replay.streams if stream.stream == Event.topic)
        assert events.recorded == events.replayed > 3
        assert (len(read_recorded(file, HandLook).of(HandLook)) > 500) == (rule == "hand")
    # A part of it as well: what was seen of the hand before goes with it.
    part = trim_session(lift["hand"][1], from_s=4.0, to_s=None, out=tmp_path / "part")
    replay = replay_file(part)
    assert replay.same, [stream for stream in replay.streams if stream.differ]
    assert _slips_s(part) == [t_s for t_s in _slips_s(lift["hand"][1]) if t_s >= 4.0] != []


def test_a_played_recording_tells_the_same_slips(lift: dict[str, tuple[Any, Path]], tmp_path: Path) -> None:
    config = check_tree({"session": {"out_dir": str(tmp_path / "out")}}, {}, base=tmp_path).config
    bus, events = Bus(), list[Event]()
    bus.subscribe(Event, events.append, vital=True)
    file = lift["hand"][1]
    play_file(file, config, speed=None, bus=bus)
    assert [event.taken_ns / 1e9 for event in events if event.kind == "slip"] == _slips_s(file)
    then = {round(one.t_ns / 1e9, 6): list(one.intensities) for one in read_recorded(file).of(VestFrame)}
    with (tmp_path / "out" / "vest.csv").open(newline="") as text:
        now = {float(row[0]): [int(v) for v in row[1:]] for row in list(csv.reader(text))[1:]}
    assert now == then
