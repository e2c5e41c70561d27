"""A session as a LeRobot dataset: the published layout, and in each frame what was known by then."""

from __future__ import annotations

import csv
import json
import os
import sys
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.command import call
from reference.lerobot_data import FPS, info, rows
from reference.sessions import record, rewritten
from tega.errors import ConfigError, RecordingError
from tega.hand import JOINT_NAMES
from tega.recording.export import export_file
from tega.recording.mcap_folder import SessionFolder, session_files
from tega.recording.trim import trim_session
from tega_lerobot.dataset import export_lerobot
from tega_lerobot.spool import Spool
from tega_lerobot.streams import Stream
from tega_lerobot.video import EpisodeCamera

parquet = pytest.importorskip("pyarrow.parquet", reason="needs the extra tega[lerobot]")
av = pytest.importorskip("av", reason="needs the extra tega[lerobot]")


@pytest.fixture(scope="module")
def dataset(lossless: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    part = trim_session(lossless, from_s=0.4, to_s=1.1, out=tmp_path_factory.mktemp("part") / "part")
    folder = tmp_path_factory.mktemp("dataset") / "dataset"
    return export_lerobot([lossless, part], folder, fps=FPS, task="lift the bottle")


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
    tasks = ["lift the bag", task or "grasp", "lift the bag"]
    assert [episode["tasks"] for episode in episodes(dataset)] == [[one] for one in tasks]
    table = parquet.read_table(dataset / "meta" / "tasks.parquet").to_pydict()
    assert table == {"task_index": [0, 1], "task": tasks[:2]}
    by_episode = {row["episode_index"]: row["task_index"] for row in rows(dataset)}
    assert by_episode == {0: 0, 1: 1, 2: 0}
    assert info(dataset)["total_tasks"] == 2


@pytest.fixture(scope="module")
def tables(lossless: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the recording's tables and pictures, as another export has them."""
    folder = tmp_path_factory.mktemp("tables") / "tables"
    export_file(lossless, folder, pictures=True)
    return folder


def table(tables: Path, name: str) -> list[dict[str, str]]:
    with (tables / f"{name}.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_a_frame_holds_what_was_newest_by_its_time(dataset: Path, tables: Path) -> None:
    def newest(name: str, t_ns: int) -> dict[str, str]:
        return [row for row in table_of[name] if float(row["log_s"]) * 1e9 <= t_ns + 0.5][-1]

    streams = ("hand.frames", "tactile.thumb.contact", "emg.levels", "vest.frame", "emg.samples")
    table_of = {name: table(tables, name) for name in streams}
    start_ns = json.loads((dataset / "meta" / "tega.json").read_text())["episodes"][0]["start_ns"]
    for k in (0, 7, 20, 30):
        row, t_ns = rows(dataset)[k], start_ns + k * 1_000_000_000 // FPS
        level = float(newest("hand.frames", t_ns)["level"])
        assert row["action"] == [level, (level - 1) / 4]
        contact = newest("tactile.thumb.contact", t_ns)
        names = info(dataset)["features"]["observation.touch"]["names"]
        thumb = dict(zip(names, row["observation.touch"], strict=True))
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


def test_the_video_shows_the_pictures(dataset: Path, tables: Path) -> None:
    import cv2

    start_ns = json.loads((dataset / "meta" / "tega.json").read_text())["episodes"][0]["start_ns"]
    frames = table(tables, "tactile.thumb.frame")
    path = dataset / "videos/observation.images.thumb/chunk-000/file-000.mp4"
    with av.open(str(path)) as video:
        displayed = [frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)]
    assert len(displayed) == info(dataset)["total_frames"]
    errors = []
    for k in range(0, episodes(dataset)[0]["length"], 6):
        t_ns = start_ns + k * 1_000_000_000 // FPS
        seq = [int(row["seq"]) for row in frames if float(row["log_s"]) * 1e9 <= t_ns + 0.5][-1]
        image = cv2.imread(str(tables / "thumb" / f"{seq:06d}.png"))
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
    for rising in (("min", "q01", "q50", "q99", "max"), ("min", "mean", "max")):
        assert (np.diff([np.ravel(colours[name]) for name in rising], axis=0) >= 0).all()


@pytest.mark.parametrize("height", [64, 66])
def test_an_episode_may_end_before_the_encoder_has_let_a_picture_go(tmp_path: Path, height: int) -> None:
    camera = EpisodeCamera(tmp_path, "observation.images.thumb", FPS, (height, 64))
    for grey in (50, 200):
        camera.begin(1)
        camera.add(np.full((height, 64, 3), grey, np.uint8), 1)
        place = camera.end()
    camera.close()
    assert place["videos/observation.images.thumb/from_timestamp"] == 1 / FPS
    with av.open(str(tmp_path / "videos/observation.images.thumb/chunk-000/file-000.mp4")) as video:
        pictures = [frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)]
    assert {picture.shape for picture in pictures} == {(height, 64, 3)}
    assert [picture.mean() for picture in pictures] == pytest.approx([50, 200], abs=10)


def test_the_colours_are_those_of_pictures_that_lerobot_would_sample(tmp_path: Path) -> None:
    n = 600
    camera = EpisodeCamera(tmp_path, "observation.images.thumb", FPS, (64, 64))
    for _ in range(2):
        camera.begin(n)
        for k in range(n // 2):
            camera.add(np.full((64, 64, 3), k // 2, np.uint8), 2)
        camera.end()
    camera.close()
    frames = np.round(np.linspace(0, n - 1, int(n**0.75)))
    assert camera.total.figures()["count"] == [2 * len(frames)]
    assert np.ravel(camera.episode.figures()["mean"]) == pytest.approx([np.mean(frames // 4) / 255] * 3)


@pytest.mark.skipif(sys.platform != "linux", reason="priorities are Linux's")
def test_the_encoder_does_not_put_this_program_before_all_others(tmp_path: Path) -> None:
    def policies() -> set[int]:
        return {os.sched_getscheduler(int(task.name)) for task in Path("/proc/self/task").iterdir()}

    before = policies()
    camera = EpisodeCamera(tmp_path, "observation.images.thumb", FPS, (64, 64))
    camera.begin(40)
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
    export = ("recording", "export", lossless, "--out", tmp_path / "new")
    call(capsys, *export, "--format", "lerobot", "--pictures", code=2)
    assert "--fps is for --format lerobot" in call(capsys, *export, "--fps", "10", code=2)[1]


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


@pytest.mark.parametrize(
    ("topic", "fields", "text"),
    [
        ("/hand/joints", ["joints"], "the records of /hand/joints hold no numbers"),
        ("/vest/frame", ["intensities"], "the records of /vest/frame hold no numbers"),
        ("/emg/samples", ["samples"], "the records of /emg/samples hold no numbers"),
        ("/tactile/thumb/image", ["width", "height", "data"], "thumb: 0×0 pixels are none, or not even"),
        ("/vest/frame", [], "its streams reach over 8760 h, at most 24 h are read"),
    ],
)
def test_records_without_numbers_or_of_a_year_ahead_are_an_error_that_names_them(
    short: Path, tmp_path: Path, topic: str, fields: list[str], text: str
) -> None:
    def emptied(of: str, value: Any) -> Any:
        for field in fields if of == topic else ():
            value.ClearField(field)
        return value

    seen: list[str] = []

    def forged(of: str, log_ns: int) -> int:
        seen.append(of)  # all but the first one of the topic are a year ahead
        return log_ns + 365 * 86_400 * 10**9 * (not fields and of == topic and seen.count(of) > 1)

    odd = rewritten(short, tmp_path / "odd.mcap", emptied, times=forged)
    with pytest.raises(RecordingError, match=rf"odd\.mcap: {text}"):
        export_lerobot([odd], tmp_path / "dataset", fps=FPS)


def test_numbers_of_a_long_episode_wait_on_disk() -> None:
    stream, n = Stream(), 20_000
    tracemalloc.start()
    for k in range(n):
        stream.add(k, (0.5,) * 6)
    held, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert held < 1 << 19 < n * (8 + 6 * 4)
    assert stream.rows.shape == (n, 6)
    with pytest.raises(ValueError, match="5 numbers after 6"):
        stream.add(n, (0.5,) * 5)


def test_a_folder_without_room_for_numbers_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile._candidate_tempdir_list", lambda: ["/gone"])
    for folder, named in (("/gone", "/gone: No such"), (None, "temporary files: No usable")):
        monkeypatch.setattr("tempfile.tempdir", folder)
        with pytest.raises(RecordingError, match=rf"{named}.*TMPDIR"):
            Spool(np.float32).add(np.zeros(100_000, np.float32))
