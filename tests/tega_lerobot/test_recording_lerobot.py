"""A session as a LeRobot dataset: the published layout, and in each frame what was known by then."""

from __future__ import annotations

import csv
import json
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.recorded import read_recorded
from reference.sessions import record, rewritten
from reference.sessions import tree as sessions_tree
from tega.errors import ConfigError, RecordingError, UnsafeNameError
from tega.hand import JOINT_NAMES
from tega.recording.export import export_file
from tega.recording.mcap_folder import SessionFolder, session_files
from tega.recording.trim import trim_session
from tega.records import Contact
from tega.ui.cli.main import main
from tega_lerobot.dataset import export_lerobot
from tega_lerobot.streams import Stream
from tega_lerobot.video import EpisodeCamera, Video
from tega_scene.pictures import times_path

parquet = pytest.importorskip("pyarrow.parquet", reason="needs the extra tega[lerobot]")
av = pytest.importorskip("av", reason="needs the extra tega[lerobot]")

FPS = 25


@pytest.fixture(scope="module")
def parts(lossless: Path, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    part = trim_session(lossless, from_s=0.4, to_s=1.1, out=tmp_path_factory.mktemp("part") / "part")
    return [lossless, part]


@pytest.fixture(scope="module")
def dataset(parts: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dataset") / "dataset"
    return export_lerobot(parts, folder, fps=FPS, task="lift the bottle")


def info(dataset: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((dataset / "meta" / "info.json").read_text())
    return content


def rows(dataset: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = parquet.read_table(dataset / "data/chunk-000/file-000.parquet").to_pylist()
    return found


def episodes(dataset: Path) -> list[dict[str, Any]]:
    path = dataset / "meta/episodes/chunk-000/file-000.parquet"
    found: list[dict[str, Any]] = parquet.read_table(path).to_pylist()
    return found


def test_the_layout_is_the_published_one(dataset: Path) -> None:
    known = info(dataset)
    assert known["codebase_version"] == "v3.0"
    assert known["fps"] == FPS
    assert (known["total_episodes"], known["total_tasks"]) == (2, 1)
    assert known["splits"] == {"train": "0:2"}
    assert known["features"]["observation.images.thumb"]["shape"] == [320, 240, 3]
    assert known["features"]["observation.state"]["names"] == list(JOINT_NAMES)
    table, reported = rows(dataset), episodes(dataset)
    assert known["total_frames"] == len(table) == reported[-1]["dataset_to_index"]
    assert [row["index"] for row in table] == list(range(len(table)))
    for number, episode in enumerate(reported):
        mine = table[episode["dataset_from_index"] : episode["dataset_to_index"]]
        assert {row["episode_index"] for row in mine} == {number}
        assert [row["frame_index"] for row in mine] == list(range(episode["length"]))
        times = np.array([row["timestamp"] for row in mine])
        assert np.abs(times - np.arange(len(mine)) / FPS).max() < 1e-6
        span_s = episode["videos/observation.images.thumb/to_timestamp"]
        span_s -= episode["videos/observation.images.thumb/from_timestamp"]
        assert span_s == pytest.approx(len(mine) / FPS)
        assert episode["tasks"] == ["lift the bottle"]
    for name, feature in known["features"].items():
        if feature["dtype"] != "video":
            shape = np.shape(table[0][name])
            assert shape == (() if feature["shape"] == [1] else tuple(feature["shape"])), name
    tasks = parquet.read_table(dataset / "meta" / "tasks.parquet").to_pydict()
    assert tasks == {"task_index": [0], "task": ["lift the bottle"]}


@pytest.mark.slow
@pytest.mark.parametrize("task", [None, "grasp something"])
def test_a_task_fills_only_what_an_episode_does_not_say(
    lossless: Path, tmp_path: Path, task: str | None
) -> None:
    folder = tmp_path / "session"
    folder.mkdir()
    for number in (1, 2, 3):
        (folder / f"trial-00{number}.mcap").write_bytes(lossless.read_bytes())
    session = SessionFolder(folder)
    session.label("lift the bag", ["trial-001.mcap", "trial-003.mcap"])
    dataset = export_lerobot(session_files(folder), tmp_path / "dataset", fps=FPS, task=task)
    assert [episode["tasks"] for episode in episodes(dataset)] == [
        ["lift the bag"],
        [task or "grasp"],
        ["lift the bag"],
    ]
    assert parquet.read_table(dataset / "meta" / "tasks.parquet").to_pydict() == {
        "task_index": [0, 1],
        "task": ["lift the bag", task or "grasp"],
    }
    by_episode = {row["episode_index"]: row["task_index"] for row in rows(dataset)}
    assert by_episode == {0: 0, 1: 1, 2: 0}
    assert info(dataset)["total_tasks"] == 2


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="the arm's process needs Linux or macOS")
def test_the_arm_is_observed_and_asked_in_one_action_with_the_hand(tmp_path: Path) -> None:
    recording = _with_arm(tmp_path)
    dataset = export_lerobot([recording], tmp_path / "dataset", fps=FPS)
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


def _with_arm(folder: Path) -> Path:
    """Record a run whose records of an arm and markers are made up."""
    from tega.config import check_tree
    from tega.loop import run_session
    from tega.records import ArmMeasured, ArmTarget, HeardMarker, Marker
    from tega.records.bus import Bus

    bus = Bus()
    reported: list[int] = []

    def observe(contact: Any) -> None:
        """Say where the arm is, each time that a fingertip says something."""
        t_ns = contact.taken_ns
        turn = (0.0, 0.0, 0.0, 1.0)
        common = {"t_ns": t_ns, "taken_ns": t_ns, "frame": "arm_base", "quaternion": turn}
        x_m = 0.5 + 0.1 * t_ns / 1e9
        bus.publish(ArmMeasured(position=(x_m, 0.0, 0.3), **common))
        if t_ns >= 500_000_000:
            bus.publish(ArmTarget(position=(x_m, 0.0, 0.5), **common))
        if not reported:
            bus.publish(Marker(t_ns=200_000_000, text="lift", source="pedal"))
            bus.publish(HeardMarker(t_ns=800_000_000, text="put down", source="another program"))
        reported.append(t_ns)

    bus.subscribe(Contact, observe)
    tree = sessions_tree(folder / "arm")
    summary = run_session(check_tree(tree, {}, base=folder).config, bus=bus)
    return folder / "arm" / str(summary["recording"]["file"])


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
    lossless: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    begun_ns = 5_000_000_000
    moved = rewritten(lossless, tmp_path / "trial-001.mcap", tables={"tega": {"start_ns": str(begun_ns)}})
    # A picture each 50 ms, from a little before the session's start on; none between 0.5 and 0.9 s.
    offsets_ms = [ms for ms in range(-90, 1700, 50) if not 500 < ms < 900]
    times_ns = [begun_ns + ms * 1_000_000 for ms in offsets_ms]
    video = filmed(tmp_path / "side.mp4", times_ns)
    out = tmp_path / "dataset"
    words = ["--out", str(out), "--format", "lerobot", "--fps", str(FPS), "--scene", f"side={video}"]
    with pytest.raises(SystemExit) as ended:
        main(["recording", "export", str(moved), *words])
    assert ended.value.code == 0, capsys.readouterr().err
    assert info(out)["features"]["observation.images.side"]["shape"] == [48, 64, 3]
    start_ns = json.loads((out / "meta" / "tega.json").read_text())["episodes"][0]["start_ns"]
    with av.open(str(out / "videos/observation.images.side/chunk-000/file-000.mp4")) as opened:
        greys = [frame.to_ndarray(format="rgb24").mean() for frame in opened.decode(video=0)]
    assert len(greys) == info(out)["total_frames"]
    for k, grey in enumerate(greys):
        at_ns = begun_ns + start_ns + k * 1_000_000_000 // FPS
        newest = sum(t_ns <= at_ns for t_ns in times_ns) - 1
        assert grey == pytest.approx(40 + 4 * newest, abs=3), k
    stats = json.loads((out / "meta" / "stats.json").read_text())["observation.images.side"]
    assert np.ravel(stats["min"])[0] < np.ravel(stats["max"])[0]


@pytest.mark.slow
def test_a_scene_camera_of_another_time_or_without_one_is_refused(lossless: Path, tmp_path: Path) -> None:
    begun_ns = 5_000_000_000
    moved = rewritten(lossless, tmp_path / "trial-001.mcap", tables={"tega": {"start_ns": str(begun_ns)}})
    late = filmed(tmp_path / "late.mp4", [begun_ns + k * 50_000_000 for k in range(20, 40)])
    short = filmed(tmp_path / "short.mp4", [begun_ns - 90_000_000 + k for k in range(3)])
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


def test_depth_and_force_are_observed_where_the_run_s_metric_measures_them(
    dataset: Path, lossless: Path
) -> None:
    feature = info(dataset)["features"]["observation.touch_si"]
    names = [f"{f}.{n}" for f in ("ring", "thumb") for n in ("area_mm2", "depth_mm", "force_n")]
    assert feature["names"] == names
    contacts = read_recorded(lossless).contacts["thumb"]
    forces = {np.float32(one.force_n) for one in contacts}
    found = [dict(zip(names, row["observation.touch_si"], strict=True)) for row in rows(dataset)]
    assert {row["thumb.force_n"] for row in found} <= forces
    assert max(row["thumb.force_n"] for row in found) > 0.5
    assert max(row["thumb.depth_mm"] for row in found) > 0.05
    assert {row["thumb.area_mm2"] for row in found} == {0.0}, "no gel's scale is known"


def test_a_frame_holds_what_was_newest_by_its_time(dataset: Path, lossless: Path, tmp_path: Path) -> None:
    export_file(lossless, tmp_path / "tables", pictures=True)

    def table(name: str) -> list[dict[str, str]]:
        with (tmp_path / "tables" / f"{name}.csv").open(newline="") as file:
            return list(csv.DictReader(file))

    def newest(name: str, t_ns: int) -> dict[str, str]:
        return [row for row in table_of[name] if float(row["log_s"]) * 1e9 <= t_ns + 0.5][-1]

    streams = ("hand.frames", "tactile.thumb.contact", "emg.levels", "vest.frame", "emg.samples")
    table_of = {name: table(name) for name in streams}
    start_ns = json.loads((dataset / "meta" / "tega.json").read_text())["episodes"][0]["start_ns"]
    for k in (0, 7, 20, 30):
        row, t_ns = rows(dataset)[k], start_ns + k * 1_000_000_000 // FPS
        level = float(newest("hand.frames", t_ns)["level"])
        assert row["action"] == [level, (level - 1) / 4]
        contact = newest("tactile.thumb.contact", t_ns)
        thumb = dict(
            zip(
                info(dataset)["features"]["observation.touch"]["names"], row["observation.touch"], strict=True
            )
        )
        assert thumb["thumb.eda"] == float(contact["eda"])
        assert thumb["thumb.cci"] == pytest.approx(float(contact["cci"]))
        levels = newest("emg.levels", t_ns)
        assert row["observation.emg_levels"][-1] == float(levels["fused"])
        vest = newest("vest.frame", t_ns)
        assert row["observation.vest"] == [float(vest[f"m{m}"]) for m in range(40)]
        samples = [r for r in table_of["emg.samples"] if float(r["log_s"]) * 1e9 <= t_ns + 0.5][
            -(1000 // FPS) :
        ]
        expected = [[np.float32(r[f"ch{c}"]) for c in (1, 2, 3)] for r in samples]
        assert np.array_equal(row["observation.emg"], expected)
        assert 0 <= row["observation.image_age"][1] < 1 / 60 + 1e-6


def test_the_video_shows_the_pictures(dataset: Path, lossless: Path, tmp_path: Path) -> None:
    import cv2

    export_file(lossless, tmp_path / "tables", pictures=True)
    start_ns = json.loads((dataset / "meta" / "tega.json").read_text())["episodes"][0]["start_ns"]
    with (tmp_path / "tables" / "tactile.thumb.frame.csv").open(newline="") as file:
        frames = list(csv.DictReader(file))
    path = dataset / "videos/observation.images.thumb/chunk-000/file-000.mp4"
    with av.open(str(path)) as video:
        displayed = [frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)]
    assert len(displayed) == info(dataset)["total_frames"]
    errors = []
    for k in range(0, episodes(dataset)[0]["length"], 6):
        t_ns = start_ns + k * 1_000_000_000 // FPS
        seq = [int(row["seq"]) for row in frames if float(row["log_s"]) * 1e9 <= t_ns + 0.5][-1]
        image = cv2.imread(str(tmp_path / "tables" / "thumb" / f"{seq:06d}.png"))
        assert image is not None
        errors.append(np.abs(image[..., ::-1].astype(float) - displayed[k]).mean())
    assert max(errors) < 6.0  # the noise of the sensor is most of it


def test_the_figures_are_those_of_the_frames(dataset: Path) -> None:
    stats = json.loads((dataset / "meta" / "stats.json").read_text())
    table = rows(dataset)
    for name in ("action", "observation.touch", "observation.emg", "timestamp"):
        values = np.array([row[name] for row in table], np.float64)
        assert np.ravel(stats[name]["mean"]) == pytest.approx(np.ravel(values.mean(0)), rel=1e-6, abs=1e-9)
        assert np.ravel(stats[name]["max"]) == pytest.approx(np.ravel(values.max(0)))
        assert np.ravel(stats[name]["q90"]) == pytest.approx(np.ravel(np.quantile(values, 0.9, axis=0)))
        assert stats[name]["count"] == [len(table)]
    colours = stats["observation.images.thumb"]
    assert np.shape(colours["mean"]) == (3, 1, 1)
    for low, high in (
        ("min", "q01"),
        ("q01", "q50"),
        ("q50", "q99"),
        ("q99", "max"),
        ("min", "mean"),
        ("mean", "max"),
    ):
        assert np.all(np.array(colours[low]) <= np.array(colours[high]))


def test_an_episode_may_end_before_the_encoder_has_let_a_picture_go(tmp_path: Path) -> None:
    camera = EpisodeCamera(tmp_path, "observation.images.thumb", FPS, (64, 64))
    for grey in (50, 200):
        camera.begin()
        camera.add(np.full((64, 64, 3), grey, np.uint8), 1)
        place = camera.end()
    camera.close()
    assert place["videos/observation.images.thumb/from_timestamp"] == 1 / FPS
    with av.open(str(tmp_path / "videos/observation.images.thumb/chunk-000/file-000.mp4")) as video:
        greys = [frame.to_ndarray(format="rgb24").mean() for frame in video.decode(video=0)]
    assert greys == pytest.approx([50, 200], abs=10)


@pytest.mark.skipif(sys.platform != "linux", reason="priorities are Linux's")
def test_the_encoder_does_not_put_this_program_before_all_others(tmp_path: Path) -> None:
    def policies() -> set[int]:
        return {os.sched_getscheduler(int(task.name)) for task in Path("/proc/self/task").iterdir()}

    before = policies()
    camera = EpisodeCamera(tmp_path, "observation.images.thumb", FPS, (64, 64))
    camera.begin()
    for _ in range(40):
        camera.add(np.zeros((64, 64, 3), np.uint8), 1)
    assert policies() == before
    camera.close()
    assert policies() == before


@pytest.mark.slow
def test_other_inputs_and_full_folders_are_refused(
    lossless: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("mine")
    with pytest.raises(ConfigError, match="is not empty"):
        export_lerobot([lossless], tmp_path / "full")
    with pytest.MonkeyPatch.context() as patch:
        from reference import sessions

        whole = sessions.tree
        patch.setattr(
            sessions, "tree", lambda folder, **r: {k: v for k, v in whole(folder, **r).items() if k != "emg"}
        )
        other = record(tmp_path / "other")
    with pytest.raises(RecordingError, match=r"differs from the first recording in .*observation\.emg"):
        export_lerobot([lossless, other], tmp_path / "mixed")
    for words in (["--format", "lerobot", "--pictures"], ["--fps", "10"]):
        with pytest.raises(SystemExit) as ended:
            main(["recording", "export", str(lossless), "--out", str(tmp_path / "new"), *words])
        assert ended.value.code == 2
    assert "--fps is for --format lerobot" in capsys.readouterr().err


def test_the_public_package_opens_it(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    public = pytest.importorskip("lerobot.datasets.lerobot_dataset", reason="needs the package lerobot")
    steps = {"action": [0.0, 1 / FPS], "observation.images.ring": [-1 / FPS, 0.0]}
    opened = public.LeRobotDataset("tega/test", root=dataset, delta_timestamps=steps, video_backend="pyav")
    assert (opened.num_episodes, opened.num_frames) == (2, info(dataset)["total_frames"])
    for k in (0, 3, len(opened) - 1):
        item = opened[k]
        assert item["observation.images.thumb"].shape == (3, 320, 240)
        assert item["observation.images.ring"].shape == (2, 3, 320, 240)
        assert item["task"] == "lift the bottle"
        assert item["action"][0].tolist() == rows(dataset)[k]["action"]


@pytest.mark.skipif(sys.platform == "win32", reason="the arm's process needs Linux or macOS")
def test_the_public_package_opens_arm_force_and_scene_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    public = pytest.importorskip("lerobot.datasets.lerobot_dataset", reason="needs the package lerobot")
    begun_ns = 5_000_000_000

    tables = {"tega": {"start_ns": str(begun_ns)}}
    recording = rewritten(_with_arm(tmp_path), tmp_path / "trial-001.mcap", tables=tables)
    side = filmed(tmp_path / "side.mp4", [begun_ns + ms * 1_000_000 for ms in range(-90, 1700, 50)])
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


@pytest.mark.parametrize(
    ("topic", "field"),
    [("/hand/joints", "joints"), ("/vest/frame", "intensities"), ("/emg/samples", "samples")],
)
def test_records_without_numbers_are_an_error_that_names_them(
    lossless: Path, tmp_path: Path, topic: str, field: str
) -> None:
    def emptied(of: str, value: Any) -> Any:
        if of == topic:
            value.ClearField(field)
        return value

    odd = rewritten(lossless, tmp_path / "odd.mcap", emptied)
    with pytest.raises(RecordingError, match=rf"odd\.mcap: the records of {topic} hold no numbers"):
        export_lerobot([odd], tmp_path / "dataset", fps=FPS)


def test_pictures_without_pixels_are_an_error_that_names_the_recording(
    lossless: Path, tmp_path: Path
) -> None:
    def emptied(topic: str, value: Any) -> Any:
        if topic == "/tactile/thumb/image":
            value.width = value.height = 0
            value.data = b""
        return value

    odd = rewritten(lossless, tmp_path / "odd.mcap", emptied)
    with pytest.raises(RecordingError, match=r"odd\.mcap: damaged, or not written by TEGA"):
        export_lerobot([odd], tmp_path / "dataset", fps=FPS)


def test_a_time_a_year_ahead_is_refused_before_there_are_frames_up_to_it(
    lossless: Path, tmp_path: Path
) -> None:
    seen: list[int] = []

    def forged(topic: str, log_ns: int) -> int:
        if topic == "/vest/frame":
            seen.append(log_ns)
            return log_ns + (365 * 86_400 * 10**9 if len(seen) > 1 else 0)
        return log_ns

    odd = rewritten(lossless, tmp_path / "odd.mcap", times=forged)
    with pytest.raises(
        RecordingError, match=r"odd\.mcap: its streams reach over 8760 h, at most 24 h are read"
    ):
        export_lerobot([odd], tmp_path / "dataset", fps=FPS)


def test_numbers_of_a_long_episode_take_four_bytes_each() -> None:
    stream, n = Stream(), 10_000
    for k in range(n):
        stream.add(k, (0.5,) * 6)
    assert stream.rows.shape == (n, 6)
    held = [one for one in vars(stream).values() if hasattr(one, "__len__")]
    assert sum(map(sys.getsizeof, held)) < 1.2 * n * (8 + 6 * 4)
    with pytest.raises(ValueError, match="5 numbers after 6"):
        stream.add(n, (0.5,) * 5)
