"""Scene cameras are recorded as video in MCAP on the session's clock, and come out as MP4 with a time code."""

from __future__ import annotations

import json
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

pytest.importorskip("cv2")
pytest.importorskip("av")
pytest.importorskip("foxglove")

from reference.command import call
from reference.filmed import SIZE, film, number_of, write_scene
from tega.errors import DeviceUnavailableError, InvalidValueError, RecordingError
from tega.recording.mcap_reader import McapReader
from tega.recording.replay.followed_file import PlayedMoment
from tega.records.bus import Bus
from tega.records.display import DisplayPicture
from tega_scene.offset import estimate_offset, flash_light, measure_offset, read_flashes
from tega_scene.pictures import (
    CameraOffset,
    keep_offset,
    offsets_path,
    read_offsets,
    read_pictures,
    read_times,
    times_path,
)
from tega_scene.played import followed_scene
from tega_scene.record import export_camera, record_cameras
from tega_scene.settings import VideoFormat
from tega_scene.video import SceneEncoder


@pytest.mark.parametrize("video", ["h264", pytest.param("av1", marks=pytest.mark.slow)])
def test_two_cameras_are_recorded_and_exported(
    tmp_path: Path, video: VideoFormat, capsys: pytest.CaptureFixture[str]
) -> None:
    source = str(film(tmp_path / "film.avi", 12))
    out = tmp_path / "scene.mcap"
    begin_ns = time.monotonic_ns()
    words = (
        "--camera",
        f"front={source}",
        "--camera",
        f"side={source}",
        "--size",
        "192x128",
        "--video",
        video,
    )
    printed, _ = call(capsys, "scene", "record", out, *words, "--json")
    end_ns = time.monotonic_ns()
    reported = json.loads(printed)["cameras"]
    assert list(reported) == ["front", "side"]
    assert {(one["pictures"], one["trouble"]) for one in reported.values()} == {(12, "")}
    reader = McapReader(out)
    messages = list(reader.messages())
    assert {(one.topic, one.schema, one.value.format) for one in messages} == {
        ("/scene/front/video", "foxglove.CompressedVideo", video),
        ("/scene/side/video", "foxglove.CompressedVideo", video),
    }
    assert reader.cut == ""
    assert reader.metadata["tega_scene.front"]["pictures"] == "12"
    side = tmp_path / "side.mp4"
    assert export_camera(out, "side", side) == 12
    times = read_times(times_path(side))
    assert begin_ns < times[0] < times[-1] < end_ns
    pictures = list(read_pictures(side))
    assert [round(t_s * 1e9) for t_s, _ in pictures] == pytest.approx(times, abs=200)
    assert [number_of(image) for _, image in pictures] == list(range(12))
    with pytest.raises(RecordingError, match="no camera 'back'"):
        export_camera(out, "back", tmp_path / "back.mp4")


def test_a_foreign_recording_is_refused_in_words(tmp_path: Path) -> None:
    """A clock that is no number, and packets that are no video."""
    for name, epoch, match in (
        ("a", "1e9", "has no epoch_ns"),
        ("b", "-5", "has no epoch_ns"),
        ("c", "5", "no whole h264"),
    ):
        packets = [(k, b"no video") for k in range(3)]
        write_scene(tmp_path / f"{name}.mcap", {"front": packets}, table={"epoch_ns": epoch})
        with pytest.raises(RecordingError, match=match):
            export_camera(tmp_path / f"{name}.mcap", "front", tmp_path / "front.mp4")
        assert not list(tmp_path.glob("front*"))


@pytest.mark.parametrize(
    ("cameras", "size", "error", "message"),
    [
        ({"front": "/dev/video98"}, SIZE, DeviceUnavailableError, "/dev/video98 does not open"),
        ({"../x": "0"}, SIZE, InvalidValueError, "x"),
        ({"front": "/dev/video98"}, (161, 120), InvalidValueError, "161×120"),
    ],
)
def test_cameras_that_cannot_be_recorded_record_nothing(
    tmp_path: Path, cameras: dict[str, str], size: tuple[int, int], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        record_cameras(tmp_path / "a.mcap", cameras, size=size, rate_hz=30, stop=lambda: True)
    assert not (tmp_path / "a.mcap").exists()


RATE_HZ, BEGIN_S = 30.0, 100.0
EXPOSURE_S = 0.01


def _flashes(tmp_path: Path) -> Path:
    """Return moments as the verb writes them, by a clock that stands still but for what is waited."""
    now = [BEGIN_S + 0.7]
    file = tmp_path / "flashes.csv"
    flash_light(
        file,
        lambda _: None,
        n_flashes=8,
        wait=lambda s: now.__setitem__(0, now[0] + s),
        clock_ns=lambda: round(now[0] * 1e9),
    )
    return file


def _light(edges: list[tuple[int, bool]], t_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how much of each exposure the light was on."""
    inside = t_s[:, None] + EXPOSURE_S * (np.arange(20) / 20 - 0.475)
    at_s = np.array([t_ns for t_ns, _ in edges]) / 1e9
    on = np.array([0.0, *(float(is_on) for _, is_on in edges)])
    return np.asarray(on[np.searchsorted(at_s, inside, side="right")].mean(1))


def _filmed(
    edges: list[tuple[int, bool]], late_s: float, seed: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return times of arrival, with jitter and lost pictures, and the light in each."""
    rng = np.random.default_rng(seed)
    taken_s = np.arange(BEGIN_S + rng.uniform(0, 1 / RATE_HZ), edges[-1][0] / 1e9 + 1.0, 1 / RATE_HZ)
    taken_s = taken_s[rng.random(len(taken_s)) > 0.02]
    arrived_s = taken_s + late_s + np.abs(rng.normal(0, 0.004, len(taken_s)))
    return np.maximum.accumulate(arrived_s + 1e-6 * np.arange(len(taken_s))), _light(edges, taken_s)


@pytest.mark.parametrize(("late_s", "seed"), [(0.0, 1), (0.021, 2), (0.047, 3), (0.26, 4), (1.1, 5)])
def test_a_known_delay_is_found_to_half_a_picture(tmp_path: Path, late_s: float, seed: int) -> None:
    edges = read_flashes(_flashes(tmp_path))
    t_s, light = _filmed(edges, late_s, seed)
    rng = np.random.default_rng(seed)
    shades = rng.normal(90, 3, (len(t_s), 30))
    shades[:, 3] += 60 * np.sin(t_s * 2.1)  # something else that gets light and dark
    shades[:, 17] += 40 * light
    found = estimate_offset(t_s, shades, edges)
    assert abs(found.late_s - late_s - 0.0032) < 0.5 / RATE_HZ  # jitter of arrival is late in the mean, too
    assert abs(found.late_s - late_s - 0.0032) < 4 * found.error_s < 0.5 / RATE_HZ
    assert found.n_edges >= 14


def test_pictures_without_the_light_are_refused(tmp_path: Path) -> None:
    edges = read_flashes(_flashes(tmp_path))
    t_s, _ = _filmed(edges, 0.05, 1)
    shades = np.random.default_rng(1).normal(90, 3, (len(t_s), 30))
    with pytest.raises(RecordingError, match="no part of the pictures follows the light"):
        estimate_offset(t_s, shades, edges)
    with pytest.raises(RecordingError, match="switchings"):
        estimate_offset(t_s[:40], shades[:40], edges)


def test_moments_of_no_light_are_refused(tmp_path: Path) -> None:
    falling = "".join(f"{9 - k},{k % 2}\n" for k in range(9))
    for rows in ("", "t_ns,on\n1,1\n", f"t_ns,on\n{falling}", "t_ns,on\n5,maybe\n"):
        (tmp_path / "f.csv").write_text(rows)
        with pytest.raises(RecordingError, match="not the moments of a light"):
            read_flashes(tmp_path / "f.csv")


def test_a_damaged_file_of_offsets_is_told(tmp_path: Path) -> None:
    recording = tmp_path / "s.mcap"
    assert read_offsets(recording) == {}
    keep_offset(recording, "front", CameraOffset(0.04, 0.002, 12))
    keep_offset(recording, "side", CameraOffset(0.09, 0.002, 12))
    assert [one.late_ns for one in read_offsets(recording).values()] == [40_000_000, 90_000_000]
    offsets_path(recording).write_text('{"front": {"late_s": 1e9, "error_s": 0, "n_edges": 1}}')
    with pytest.raises(RecordingError, match="no offsets of scene cameras"):
        read_offsets(recording)


@pytest.mark.slow
def test_an_offset_is_measured_in_a_recording_and_taken_off_by_export(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    late_s = 0.053
    edges = read_flashes(_flashes(tmp_path))
    t_s, light = _filmed(edges, late_s, 6)
    encoder, rng, packets = SceneEncoder(160, 120, rate_hz=RATE_HZ), np.random.default_rng(6), []
    for at_s, lit in zip(t_s, light, strict=True):
        image = rng.integers(60, 90, (120, 160)).astype(np.uint8)
        image[50:80, 90:130] += np.uint8(70 * lit)
        packets += encoder.encode(image, round(at_s * 1e9))
    recording = write_scene(tmp_path / "scene.mcap", {"front": packets})
    printed, _ = call(capsys, "scene", "offset", recording, "front", tmp_path / "flashes.csv", "--json")
    found = json.loads(printed)
    assert abs(found["late_s"] - late_s - 0.0032) < 0.5 / RATE_HZ
    call(capsys, "scene", "export", recording, "front", tmp_path / "front.mp4")
    exported = np.array(read_times(times_path(tmp_path / "front.mp4"))) / 1e9
    assert np.abs(exported - (t_s - found["late_s"])).max() < 1e-6
    # What is played shows a picture when it was taken, not when it came.
    bus, seen = Bus(), list[int]()
    bus.subscribe(DisplayPicture, lambda one: seen.append(one.t_ns), vital=True)
    film = followed_scene(recording, bus, start_ns=0, end_ns=2**62)
    for at_s in (BEGIN_S + 2.0, BEGIN_S + 3.5):
        film.follow(PlayedMoment(0, round(at_s * 1e9), 0), threading.Event())
        assert seen[-1] / 1e9 == pytest.approx(exported[exported <= at_s][-1], abs=1e-6)
    with pytest.raises(RecordingError, match="no camera 'side'"):
        measure_offset(recording, "side", tmp_path / "flashes.csv")
