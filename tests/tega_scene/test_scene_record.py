"""Scene cameras are recorded as video in MCAP on the session's clock, and come out as MP4 with a time code."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest
from click.testing import CliRunner

pytest.importorskip("cv2")
pytest.importorskip("av")
pytest.importorskip("foxglove")

from reference.filmed import SIZE, film, number_of, numbered, write_scene
from tega.errors import DeviceUnavailableError, InvalidValueError, RecordingError
from tega.recording.mcap_reader import McapReader
from tega.recording.record_columns import find_kind
from tega.ui.cli.main import cli
from tega_scene.pictures import read_pictures, read_times, times_path
from tega_scene.record import export_camera, record_cameras
from tega_scene.settings import VideoFormat
from tega_scene.video import SceneDecoder, SceneEncoder, SceneVideo


@pytest.mark.parametrize("video", ["h264", pytest.param("av1", marks=pytest.mark.slow)])
def test_every_packet_is_one_picture_and_none_waits(video: VideoFormat) -> None:
    encoder, decoder = SceneEncoder(*SIZE, rate_hz=30, video=video), SceneDecoder(video)
    for number in range(10):
        (packet,) = encoder.encode(numbered(number), 1000 * number + 7)
        decoder.take(*packet)
        displayed = decoder.image()
        assert displayed is not None
        assert (displayed[0], number_of(displayed[1])) == (packet[0], number) == (1000 * number + 7, number)


def test_its_topic_has_the_scene_s_record_type() -> None:
    assert find_kind("/scene/front/video", "foxglove.CompressedVideo") == (SceneVideo, {"camera": "front"})


def test_an_odd_size_is_refused() -> None:
    with pytest.raises(InvalidValueError, match="161×120"):
        SceneEncoder(161, 120, rate_hz=30)


@pytest.mark.parametrize("video", ["h264", pytest.param("av1", marks=pytest.mark.slow)])
def test_two_cameras_are_recorded_and_exported(tmp_path: Path, video: VideoFormat) -> None:
    source = str(film(tmp_path / "film.avi", 12))
    out = tmp_path / "scene.mcap"
    begin_ns = time.monotonic_ns()
    text = CliRunner().invoke(
        cli,
        ["scene", "record", str(out), "--camera", f"front={source}", "--camera", f"side={source}", "--size", "192x128",
         "--video", video, "--json"],
    )  # fmt: skip
    end_ns = time.monotonic_ns()
    assert text.exit_code == 0, text.output
    reported = json.loads(text.output)["cameras"]
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


def test_a_camera_that_is_not_there_records_nothing(tmp_path: Path) -> None:
    out = tmp_path / "scene.mcap"
    with pytest.raises(DeviceUnavailableError, match="/dev/video98 does not open"):
        record_cameras(out, {"front": "/dev/video98"}, size=SIZE, rate_hz=30, stop=lambda: True)
    assert not out.exists()


def test_a_name_that_leaves_its_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidValueError):
        record_cameras(tmp_path / "a.mcap", {"../x": "0"}, size=SIZE, rate_hz=30, stop=lambda: True)
