"""Arm, depth, force and scene cameras in a LeRobot dataset, and what its public package makes of them."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from reference.command import call
from reference.lerobot_data import FPS, info, rows
from reference.sessions import record_with_arm, rewritten
from tega.errors import ConfigError, RecordingError, UnsafeNameError
from tega_lerobot.dataset import export_lerobot
from tega_lerobot.video import Video
from tega_scene.pictures import times_path

parquet = pytest.importorskip("pyarrow.parquet", reason="needs the extra tega[lerobot]")
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
