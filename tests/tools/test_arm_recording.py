"""An arm in a recording: what led it is in the file, computes again to the same bits, and is seen by viewers."""

from __future__ import annotations

import csv
import itertools
import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.parts import Running
from reference.processes import until
from tega.config import check_tree
from tega.errors import RecordingError
from tega.recording.export import export_file
from tega.recording.inspection import inspect_file
from tega.recording.mcap_index import open_indexed
from tega.recording.mcap_reader import McapReader
from tega.recording.poses_file import PosesFile, PosesFileOptions, forearm
from tega.recording.replay import replay_file
from tega.recording.trim import trim_session
from tega_emulators.lab import emulated_lab
from tega_emulators.scripted_poses import write_poses
from tega_figures.arm_path import follow_path, hand_of, hand_path, tracked

pytestmark = [pytest.mark.slow, pytest.mark.skipif(sys.platform == "win32", reason="needs Linux or macOS")]
pytest.importorskip("foxglove", reason="comes with the extra record")

# What the run shows, or how long it goes on, then what is said to dead-man (0) and clutch (1) and to the headset.
_STEPS = (
    ("idle", ("press 0", "press 1"), ""),
    ("following", (), "wave 0.1 0.3"),
    ("1.5 s", (), "jump 0.4 0 0"),
    ("0.5 s", ("lift 0",), ""),
    ("holding", ("press 0",), ""),
    ("following", (), "lose"),
    ("idle", (), ""),
    ("0.3 s", (), ""),
)


def _wait(run: Running, wanted: str) -> None:
    since_ns = run.view.t_ns
    if wanted.endswith(" s"):
        until(lambda: run.view.t_ns - since_ns >= 1e9 * float(wanted[:-2]))
    else:
        until(lambda: run.view.arm.startswith(wanted))


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("arm")
    with emulated_lab(folder, arm=True) as lab:
        tree = {**lab.tree, "recording": {"dir": str(folder / "session")}}
        with Running(check_tree(tree, {}, base=folder).config) as run:
            for wanted, buttons, headset in _STEPS:
                _wait(run, wanted)
                for word in buttons:
                    lab.cap.say(word)
                if headset:
                    lab.headset.say(headset)
    (folder / "summary.json").write_text(json.dumps(run.summary), encoding="utf-8")
    return folder / "session"


def _values(session: Path, topic: str) -> list[Any]:
    messages = McapReader(session / "trial-001.mcap").messages(lambda one: one == topic, every=False)
    return [message.value for message in messages]


def test_what_led_the_arm_computes_again_to_the_same_bits(session: Path) -> None:
    replay = replay_file(session / "trial-001.mcap")
    (turns,) = (s for s in replay.streams if s.stream == "/arm/turn")
    assert turns.recorded == turns.replayed > 200
    assert (turns.differ, turns.first) == (0, [])
    assert replay.same
    states = {row.state for row in _values(session, "/arm/turn")}
    assert {"idle", "following", "holding", "stopped"} <= states


def test_a_changed_setting_and_what_comes_of_it_are_named(session: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.toml"
    other.write_text('[arm]\ndriver = "simulated-arm"\n[arm.filter]\nbeta_per_m = 10.01\n', encoding="utf-8")
    replay = replay_file(session / "trial-001.mcap", config=other)
    assert replay.changed == ["arm.filter.beta_per_m: 10.0 -> 10.01"]
    (turns,) = (s for s in replay.streams if s.stream == "/arm/turn")
    assert turns.differ > 0
    assert set(turns.fields) <= {f"{subject}_{axis}" for subject in ("target", "velocity") for axis in "xyz"}


def test_a_part_of_it_computes_to_the_same_bits_too(session: Path, tmp_path: Path) -> None:
    part = trim_session(session, from_s=1.0, to_s=2.0, out=tmp_path / "part")
    (turns,) = (s for s in replay_file(part).streams if s.stream == "/arm/turn")
    assert 20 < turns.recorded < 200
    assert turns.differ == 0


def test_viewers_see_forearm_target_and_hand_as_poses_of_a_well_known_kind(session: Path) -> None:
    kinds = open_indexed(session / "trial-001.mcap").topics
    assert {topic: schema for topic, schema in kinds.items() if topic.startswith("/arm/")} == {
        "/arm/axes": "foxglove.FrameTransform",
        "/arm/forearm": "foxglove.PoseInFrame",
        "/arm/measured": "foxglove.PoseInFrame",
        "/arm/target": "foxglove.PoseInFrame",
        "/arm/sent": "foxglove.PoseInFrame",
        "/arm/turn": "tega.ArmTurn",
        "/arm/health": "tega.ArmHealth",
    }
    turns = _values(session, "/arm/turn")
    # What viewers see is what was computed with, number for number, but for poses that the tracker calls lost.
    seen = [list(p.position) for turn in turns for p in turn.poses if p.valid]
    assert any(not p.valid for turn in turns for p in turn.poses)
    assert [
        [p.pose.position.x, p.pose.position.y, p.pose.position.z] for p in _values(session, "/arm/forearm")
    ] == seen
    displayed = [p.pose.position.x for p in _values(session, "/arm/target")]
    assert displayed == [turn.target[0] for turn in turns if turn.target]
    assert {p.frame_id for p in _values(session, "/arm/forearm")} == {"tracker"}
    assert {p.frame_id for p in _values(session, "/arm/target")} == {"arm_base"}


def test_the_arm_s_health_is_recorded_every_second(session: Path) -> None:
    at_ns = [health.t_ns for health in _values(session, "/arm/health")]
    turns_ns = [turn.t_ns for turn in _values(session, "/arm/turn")]
    assert len(at_ns) >= 2
    assert min(np.diff([*at_ns, max(at_ns[-1] + 10**9, turns_ns[-1])])) >= 10**9
    assert max(np.diff(at_ns)) < 1.1e9


def test_the_summary_s_distance_from_the_target_is_that_of_the_recorded_turns(session: Path) -> None:
    turns = [turn for turn in _values(session, "/arm/turn") if turn.state == "following"]
    off_mm = np.array(
        [1e3 * math.dist(t.target[:3], t.measured[0].position) for t in turns if t.target and t.measured]
    )
    summary = json.loads((session.parent / "summary.json").read_text(encoding="utf-8"))
    assert summary["arm"]["off_target_mm"] == pytest.approx(
        {"rms": np.sqrt(np.mean(off_mm**2)), "worst": off_mm.max()}, abs=0.006
    )


def test_what_the_arm_was_really_sent_keeps_to_its_own_speed(session: Path) -> None:
    sent = [
        (
            p.timestamp.seconds + 1e-9 * p.timestamp.nanos,
            (p.pose.position.x, p.pose.position.y, p.pose.position.z),
        )
        for p in _values(session, "/arm/sent")
    ]
    assert len(sent) > 50
    assert max(p[0] for _, p in sent) - min(p[0] for _, p in sent) > 0.02
    # Ticks that come late make up for two periods; the clock itself is read once a tick.
    assert all(math.dist(a, b) <= 0.5 * (later - s) + 0.01 for (s, a), (later, b) in itertools.pairwise(sent))


def test_inspect_tells_rates_and_how_old_a_pose_was(session: Path) -> None:
    inspection = inspect_file(session / "trial-001.mcap")
    rates = {s.topic: s.rate_hz for s in inspection.streams}
    assert (rates["/arm/turn"] or 0) > 20
    assert (rates["/arm/forearm"] or 0) > 10
    assert inspection.sources["arm"].startswith("simulated-arm: ")
    assert inspection.sources["forearm"].startswith("hololens: HoloLens at ")
    assert "forearm pose: captured to taken in" in {stage.stage for stage in inspection.latency}


def test_tables_of_it_have_a_row_a_turn(session: Path, tmp_path: Path) -> None:
    export_file(session / "trial-001.mcap", tmp_path / "tables")
    with (tmp_path / "tables" / "arm.turn.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    turns = _values(session, "/arm/turn")
    assert [float(r["target_1"]) for r in rows if r["target_1"]] == [t.target[0] for t in turns if t.target]
    with (tmp_path / "tables" / "arm.target.csv").open(encoding="utf-8") as file:
        assert [float(r["x"]) for r in csv.DictReader(file)] == [t.target[0] for t in turns if t.target]


def test_a_recorded_forearm_is_a_path_for_the_simulated_arm(session: Path) -> None:
    raw = [p for turn in _values(session, "/arm/turn") for p in turn.poses]
    hand = hand_of(session)
    assert [pose.valid for pose in hand] == [p.valid for p in raw]
    first, (x, y, z) = next((pose, p.position) for pose, p in zip(hand, raw, strict=True) if p.valid)
    assert list(first.position_m) == [-z, -x, y]  # from the headset's axes to the base's


def test_a_recorded_forearm_leads_the_next_run(session: Path, tmp_path: Path) -> None:
    tracker = {"driver": "poses-file", "options": {"file": str(session)}}
    tree = {
        "arm": {"driver": "simulated-arm", "tracker": tracker},
        "input": {
            "dead_man": {"driver": "spacemouse", "button": "left", "options": {"silent_after_ms": 10_000.0}}
        },
        "recording": {"dir": str(tmp_path / "next")},
    }
    with emulated_lab(tmp_path, arm=True) as lab:  # for its buttons
        lab.cap.say("lift 0")
        with Running(check_tree(tree, {}, base=tmp_path).config) as run:
            _wait(run, "idle: the clutch is open")
            lab.cap.say("press 0")
            until(lambda: "has ended" in run.view.arm or run.view.arm.startswith("stopped"))
    assert any(view.arm.startswith("following") for view in run.views)
    (_, first), (_, second) = (forearm(folder / "trial-001.mcap") for folder in (session, tmp_path / "next"))
    played = [(pose.position_m, pose.quaternion_xyzw, pose.valid) for pose in second]
    assert played == [(pose.position_m, pose.quaternion_xyzw, pose.valid) for pose in first][: len(played)]
    assert len(played) > 100


def test_a_recorded_forearm_in_other_axes_is_refused(session: Path) -> None:
    with pytest.raises(RecordingError, match="was recorded in the axes 'openxr', not 'base'"):
        PosesFile(PosesFileOptions(file=session, frame="base")).open()


def test_a_recorded_hand_picks_and_places(tmp_path: Path) -> None:
    pytest.importorskip("mujoco", reason="pip install '.[sim]'")
    path, file = hand_path(), tmp_path / "hand.csv"
    write_poses(file, tracked(path.at, path.duration_s, seed=1))
    default = follow_path(hand_of(file), path)
    assert default.following > 0.98
    assert default.shape_mm < 10
    assert default.turn_mrad < 40
    assert default.placed.lifted_m > 0.19
    assert default.placed.placed
