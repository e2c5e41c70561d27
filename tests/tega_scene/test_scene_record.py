"""Scene cameras are recorded as video in MCAP on the session's clock, and come out as MP4 with a time code."""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

cv2 = pytest.importorskip("cv2")
pytest.importorskip("av")
pytest.importorskip("foxglove")

from foxglove import channels, messages  # noqa: E402

from tega.errors import DeviceUnavailableError, InvalidValueError, RecordingError  # noqa: E402
from tega.recording.mcap_file import McapFile  # noqa: E402
from tega.recording.mcap_reader import McapReader  # noqa: E402
from tega.recording.record_columns import find_kind  # noqa: E402
from tega.ui.cli.main import cli  # noqa: E402
from tega_scene.pictures import read_pictures, read_times, times_path  # noqa: E402
from tega_scene.record import export_camera, record_cameras  # noqa: E402
from tega_scene.records import SceneVideo  # noqa: E402
from tega_scene.settings import VideoFormat  # noqa: E402
from tega_scene.video import SceneDecoder, SceneEncoder  # noqa: E402

SIZE = (160, 120)


def _shade(number: int) -> int:
    return 40 + 10 * number


def _film(path: Path, n: int = 12) -> Path:
    """Return a video whose pictures get lighter one by one."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 30, SIZE)
    for number in range(n):
        writer.write(np.full((SIZE[1], SIZE[0], 3), _shade(number), np.uint8))
    writer.release()
    return path


@pytest.mark.parametrize("video", ["h264", pytest.param("av1", marks=pytest.mark.slow)])
def test_every_packet_is_one_picture_and_none_waits(video: VideoFormat) -> None:
    encoder, decoder = SceneEncoder(*SIZE, rate_hz=30, video=video), SceneDecoder(video)
    seen = []
    for number in range(10):
        packets = encoder.encode(np.full((SIZE[1], SIZE[0]), _shade(number), np.uint8), 1000 * number + 7)
        assert [t_ns for t_ns, _ in packets] == [1000 * number + 7]
        for packet in packets:
            decoder.take(*packet)
            displayed = decoder.image()
            assert displayed is not None
            seen.append((displayed[0], float(displayed[1].mean())))
    assert [t_ns for t_ns, _ in seen] == [1000 * number + 7 for number in range(10)]
    assert all(abs(mean - _shade(number)) < 3 for number, (_, mean) in enumerate(seen))


def test_its_topic_has_the_scene_s_record_type() -> None:
    assert find_kind("/scene/front/video", "foxglove.CompressedVideo") == (SceneVideo, {"camera": "front"})


def test_an_odd_size_is_refused() -> None:
    with pytest.raises(InvalidValueError, match="161×120"):
        SceneEncoder(161, 120, rate_hz=30)


@pytest.mark.parametrize("video", ["h264", pytest.param("av1", marks=pytest.mark.slow)])
def test_two_cameras_are_recorded_and_exported(tmp_path: Path, video: VideoFormat) -> None:
    source = str(_film(tmp_path / "film.avi"))
    out = tmp_path / "scene.mcap"
    begin_ns = time.monotonic_ns()
    text = CliRunner().invoke(
        cli,
        ["scene", "record", str(out), "--camera", f"front={source}", "--camera", f"side={source}", "--size", "160x120",
         "--video", video, "--json"],
    )  # fmt: skip
    end_ns = time.monotonic_ns()
    assert text.exit_code == 0, text.output
    reported = json.loads(text.output)["cameras"]
    assert [(name, one["pictures"], one["trouble"]) for name, one in reported.items()] == [
        ("front", 12, ""),
        ("side", 12, ""),
    ]
    reader = McapReader(out)
    messages = list(reader.messages())
    assert {(one.topic, one.schema, one.value.format) for one in messages} == {
        ("/scene/front/video", "foxglove.CompressedVideo", video),
        ("/scene/side/video", "foxglove.CompressedVideo", video),
    }
    assert reader.cut == ""
    assert reader.metadata["tega_scene.front"]["pictures"] == "12"
    film = tmp_path / "side.mp4"
    assert export_camera(out, "side", film) == 12
    times = read_times(times_path(film))
    assert begin_ns < times[0] < times[-1] < end_ns
    pictures = list(read_pictures(film))
    assert [round(t_s * 1e9) for t_s, _ in pictures] == pytest.approx(times, abs=200)
    assert all(abs(image.mean() - _shade(number)) < 4 for number, (_, image) in enumerate(pictures))
    with pytest.raises(RecordingError, match="no camera 'back'"):
        export_camera(out, "back", tmp_path / "back.mp4")


def test_a_foreign_recording_is_refused_in_words(tmp_path: Path) -> None:
    """A clock that is no number, and packets that are no video."""
    for name, epoch, match in (
        ("a", "1e9", "has no epoch_ns"),
        ("b", "-5", "has no epoch_ns"),
        ("c", "5", "no whole h264"),
    ):
        file = McapFile(tmp_path / f"{name}.mcap", lossless=True)
        file.metadata("tega_scene", {"epoch_ns": epoch})
        channel = channels.CompressedVideoChannel("/scene/front/video", context=file.context)
        for k in range(3):
            at = messages.Timestamp(0, 1000 + k)
            channel.log(
                messages.CompressedVideo(timestamp=at, frame_id="front", data=b"no video", format="h264"),
                log_time=1000 + k,
            )
        file.close()
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
