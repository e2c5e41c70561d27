"""Arm, force and scene cameras in a LeRobot dataset, and a running session as LeRobot observes it."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from reference.command import call
from reference.lerobot_data import FPS, info, rows
from reference.sessions import record_with_arm, rewritten, tree
from tega.config import SessionConfig, check_tree
from tega.errors import ConfigError, DeviceUnavailableError, RecordingError, UnsafeNameError
from tega.hand import JOINT_NAMES
from tega.loop.program import session
from tega.recording.opened import open_recording
from tega_lerobot import live as module
from tega_lerobot.dataset import export_lerobot
from tega_lerobot.live import Live, emg_channel_count, feature_names
from tega_lerobot.video import Video
from tega_scene.pictures import times_path

pytest.importorskip("pyarrow.parquet", reason="needs the extra tega[lerobot]")
av = pytest.importorskip("av", reason="needs the extra tega[lerobot]")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="the arm's process needs Linux or macOS")
def test_the_arm_is_observed_and_asked_in_one_action_with_the_hand(tmp_path: Path) -> None:
    dataset = export_lerobot([record_with_arm(tmp_path / "arm")], tmp_path / "dataset", fps=FPS)
    features, table = info(dataset)["features"], rows(dataset)
    names = ["x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"]
    assert features["observation.arm"] == {
        "dtype": "float32", "shape": [7], "names": [f"arm.{name}" for name in names],
    }  # fmt: skip
    assert features["action"]["names"] == [
        "grasp_level",
        "closure",
        *(f"arm_target.{name}" for name in names),
    ]
    (episode,) = json.loads((dataset / "meta" / "tega.json").read_text())["episodes"]
    start_s = episode["start_ns"] / 1e9
    for k, row in enumerate(table):
        t_s = start_s + k / FPS
        # The measured arm moves by 0.1 m/s along x; it is led from half a second on, 0.2 m higher.
        assert row["observation.arm"][0] == pytest.approx(0.5 + 0.1 * t_s, abs=0.1 / 30)
        if abs(t_s - 0.5) > 1 / 30:  # how long a fingertip may say nothing new
            assert row["action"][4] == pytest.approx(0.5 if t_s > 0.5 else 0.3, abs=1e-6), t_s
        assert row["action"][5:] == pytest.approx([0, 0, 0, 1])
    assert [(m["text"], m["source"], m["frame_index"]) for m in episode["markers"]] == [
        ("lift", "pedal", int((0.2 - start_s) * FPS + 1e-9)),
        ("put down", "another program", int((0.8 - start_s) * FPS + 1e-9)),
    ]


BEGUN_NS = 5_000_000_000
STARTED = {"tega": {"start_ns": str(BEGUN_NS)}}


@pytest.fixture(scope="module")
def moved(lossless: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return rewritten(lossless, tmp_path_factory.mktemp("moved") / "trial-001.mcap", tables=STARTED)


def filmed(video: Path, times_ns: list[int]) -> Path:
    """Write a scene camera's video, a grey that rises with each picture, and its time code."""
    made = Video(video, fps=30, height=48, width=64)
    for k in range(len(times_ns)):
        made.add(np.full((48, 64, 3), 40 + 4 * k, np.uint8), 1)
    made.close()
    lines = [f"{k},{t_ns}" for k, t_ns in enumerate(times_ns)]
    times_path(video).write_text("\n".join(["picture,t_ns", *lines]) + "\n")
    return video


def test_a_scene_camera_is_laid_on_the_frames_by_the_machine_s_clock(
    moved: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # A picture each 50 ms, from a little before the session's start on; none between 0.5 and 0.9 s.
    offsets_ms = [ms for ms in range(-90, 1700, 50) if not 500 < ms < 900]
    times_ns = [BEGUN_NS + ms * 1_000_000 for ms in offsets_ms]
    video = filmed(tmp_path / "side.mp4", times_ns)
    out = tmp_path / "dataset"
    words = ("--out", out, "--format", "lerobot", "--fps", FPS, "--scene", f"side={video}")
    call(capsys, "recording", "export", moved, *words)
    assert info(out)["features"]["observation.images.side"]["shape"] == [48, 64, 3]
    start_ns = json.loads((out / "meta" / "tega.json").read_text())["episodes"][0]["start_ns"]
    with av.open(str(out / "videos/observation.images.side/chunk-000/file-000.mp4")) as opened:
        greys = [frame.to_ndarray(format="rgb24").mean() for frame in opened.decode(video=0)]
    assert len(greys) == info(out)["total_frames"]
    for k, grey in enumerate(greys):
        at_ns = BEGUN_NS + start_ns + k * 1_000_000_000 // FPS
        newest = sum(t_ns <= at_ns for t_ns in times_ns) - 1
        assert grey == pytest.approx(40 + 4 * newest, abs=3), k
    stats = json.loads((out / "meta" / "stats.json").read_text())["observation.images.side"]
    assert np.ravel(stats["min"])[0] < np.ravel(stats["max"])[0]


@pytest.mark.slow
def test_a_scene_camera_of_another_time_or_without_one_is_refused(moved: Path, tmp_path: Path) -> None:
    late = filmed(tmp_path / "late.mp4", [BEGUN_NS + k * 50_000_000 for k in range(20, 40)])
    short = filmed(tmp_path / "short.mp4", [BEGUN_NS - 90_000_000 + k for k in range(3)])
    for number, video in enumerate((late, short)):
        with pytest.raises(RecordingError, match=r"does not cover trial-001\.mcap"):
            export_lerobot([moved], tmp_path / f"out{number}", fps=FPS, scenes={"side": video})
    with pytest.raises(ConfigError, match="named as a finger"):
        export_lerobot([moved], tmp_path / "finger", fps=FPS, scenes={"thumb": late})
    times_path(late).unlink()
    with pytest.raises(RecordingError, match="has no time code"):
        export_lerobot([moved], tmp_path / "untimed", fps=FPS, scenes={"side": late})
    with pytest.raises(UnsafeNameError):
        export_lerobot([moved], tmp_path / "unsafe", fps=FPS, scenes={"../side": late})


@pytest.mark.skipif(sys.platform == "win32", reason="the arm's process needs Linux or macOS")
def test_the_public_package_opens_arm_force_and_scene_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    public = pytest.importorskip("lerobot.datasets.lerobot_dataset", reason="needs the package lerobot")
    recording = rewritten(record_with_arm(tmp_path / "arm"), tmp_path / "trial-001.mcap", tables=STARTED)
    side = filmed(tmp_path / "side.mp4", [BEGUN_NS + ms * 1_000_000 for ms in range(-90, 1700, 50)])
    dataset = export_lerobot(
        [recording], tmp_path / "dataset", fps=FPS, task="lift the bag", scenes={"side": side}
    )
    opened = public.LeRobotDataset("tega/test", root=dataset, video_backend="pyav")
    table = rows(dataset)
    assert set(opened.meta.video_keys) == {f"observation.images.{name}" for name in ("thumb", "ring", "side")}
    greys = []
    for k in (0, len(opened) // 2, len(opened) - 1):
        item = opened[k]
        for name, feature in opened.meta.features.items():
            if feature["dtype"] == "float32" and name != "timestamp":
                assert np.array_equal(item[name].numpy(), np.array(table[k][name], np.float32)), name
        assert item["observation.arm"].shape == (7,)
        assert item["action"].shape == (9,)
        assert item["observation.touch_si"].shape == (6,)
        assert item["observation.emg"].shape == (1000 // FPS, 3)
        assert item["observation.vest"].shape == (40,)
        assert item["observation.state"].shape == (16,)
        assert item["observation.images.side"].shape == (3, 48, 64)
        assert item["task"] == "lift the bag"
        greys.append(255 * float(item["observation.images.side"].mean()))
    assert greys == sorted(greys)
    assert greys[-1] - greys[0] > 20  # the camera's pictures get brighter by 4 of 255 each 50 ms


class Observed(NamedTuple):
    """What was observed of a session, and its settings, recording and summary."""

    config: SessionConfig
    live: Live
    pictures: dict[str, NDArray[np.uint8]]
    small: dict[str, NDArray[np.uint8]]
    errors: list[str]
    file: Path


@pytest.fixture(scope="module")
def observed(tmp_path_factory: pytest.TempPathFactory) -> Observed:
    folder = tmp_path_factory.mktemp("observed")
    made_up = {"driver": "synthetic-emg", "kind": "raw", "options": {"duration_s": 1.5}}
    config = check_tree(tree(folder) | {"emg": made_up}, {}, base=folder).config
    n_channels = emg_channel_count(config)
    known, other = (feature_names(config, emg_channels=n) for n in (n_channels, n_channels + 1))
    s, errors = session(config), list[str]()
    live = Live(s)

    def fails(call: Callable[..., object], *given: Any, **how: Any) -> None:
        with pytest.raises((ConfigError, DeviceUnavailableError)) as refused:
            call(*given, **how)
        errors.append(str(refused.value))

    fails(live.closure_numbers)
    with s:
        live.wait({"observation.touch": known["observation.touch"]}, ["thumb", "ring"], patience_s=30)
        live.wait({"observation.emg_levels": None}, [], patience_s=30)
        pictures, small = live.pictures(height=320, width=240), live.pictures(height=80, width=60)
        level, closure = live.closure_numbers()
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(module, "_STALE_S", 0.0)
            fails(live.closure_numbers)
            fails(live.pictures, height=80, width=60)
        fails(live.wait, {"observation.emg_levels": other["observation.emg_levels"]}, [], patience_s=30)
        fails(live.wait, {"observation.arm": None}, [], patience_s=30)
        for _ in s:
            pass
    assert 1 <= level <= 5
    assert 0 <= closure <= 1
    return Observed(config, live, pictures, small, errors, folder / s.summary["recording"]["file"])


def test_a_session_is_observed_under_the_names_of_the_export(observed: Observed, tmp_path: Path) -> None:
    export_lerobot([observed.file], tmp_path / "dataset", fps=25)
    exported = json.loads((tmp_path / "dataset" / "meta" / "info.json").read_text())["features"]
    known = feature_names(observed.config, emg_channels=emg_channel_count(observed.config))
    assert known
    assert known == {name: exported[name]["names"] for name in known}
    counters = {"timestamp", "frame_index", "episode_index", "index", "task_index"}
    pictures = {f"observation.images.{finger}" for finger in ("thumb", "ring")}
    assert set(exported) - set(known) == counters | pictures | {"observation.emg"}


def test_the_newest_values_are_those_of_the_recording(observed: Observed) -> None:
    recording, live = open_recording(observed.file), observed.live
    joints = live.numbers(["observation.state"])
    assert list(joints.values()) == pytest.approx(recording["/hand/joints"][-1].angles_rad)
    assert list(joints) == list(JOINT_NAMES)
    forces = live.numbers(["observation.touch_si"])
    for finger in ("thumb", "ring"):
        contact = recording[f"/tactile/{finger}/contact"][-1]
        assert forces[f"{finger}.force_n"] == pytest.approx(contact.force_n or 0.0)
        newest, picture = recording[f"/tactile/{finger}/image"], observed.pictures[finger]
        assert any(np.array_equal(picture[..., ::-1], one) for one in newest)
        assert observed.small[finger].shape == (80, 60, 3)
        assert abs(observed.small[finger].mean() - picture.mean()) < 1


def test_the_past_other_channels_and_what_never_comes_are_errors(observed: Observed) -> None:
    n = emg_channel_count(observed.config)
    for error, text in zip(
        observed.errors,
        (
            "/emg/levels: nothing new",
            "/emg/levels: nothing new",
            r"/tactile/.*/image: nothing new",
            f"the EMG has {n} channels, not {n + 1}; set emg_channels",
            r"run has ended|not yet observed: observation\.arm",
        ),
        strict=True,
    ):
        assert re.search(text, error)
