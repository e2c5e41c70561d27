"""Videos of other programs: their codec, their frames' times and orientation, and files that are not whole."""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from reference.recordings import write_video
from reference.videos import CODECS, encode, numbered, shade
from tega.devices.base import TactileFrame
from tega.devices.fingertip.video import VideoFile, VideoFileOptions
from tega.errors import RecordingError
from tega_scene.pictures import read_pictures

_EACH = [(codec, suffix) for codec, suffixes in CODECS.items() for suffix in suffixes]


def frames_of(path: Path, **options: bool) -> list[TactileFrame]:
    found = []
    with VideoFile(VideoFileOptions(file=path, **options)) as source:
        while (frame := source.read(0)) is not None:
            found.append(frame)
        assert source.ended
        assert source.info.n_items == len(found)
    return found


@pytest.mark.parametrize(("codec", "suffix"), _EACH)
@settings(max_examples=3, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(steps_ms=st.lists(st.integers(5, 400), min_size=9, max_size=25))
def test_every_frame_of_any_codec_comes_at_its_own_time(
    codec: str, suffix: str, steps_ms: list[int], tmp_path: Path
) -> None:
    times_ms = [int(t) for t in np.cumsum([0, *steps_ms])]
    path = encode(tmp_path / f"v{suffix}", numbered(len(times_ms)), times_ms, codec=codec)
    frames = frames_of(path)
    assert [f.seq for f in frames] == list(range(len(times_ms)))
    assert [f.t_ns / 1e6 for f in frames] == pytest.approx(times_ms, abs=0.5)
    shades = [shade(f.image) for f in frames]
    assert shades == pytest.approx([80 + 160 * k / (len(shades) - 1) for k in range(len(shades))], abs=8)
    assert [t_s * 1000 for t_s, _ in read_pictures(path)] == pytest.approx(times_ms, abs=0.5)


def test_a_remuxed_file_has_the_same_times(tmp_path: Path) -> None:
    times_ms = [0, 200, 400, 433, 466, 500, 533, 566, 900, 1300]
    path = encode(tmp_path / "v.mp4", numbered(10), times_ms, codec="h264")
    other = tmp_path / "v.mkv"
    with av.open(str(path)) as source, av.open(str(other), "w") as sink:
        stream = sink.add_stream_from_template(source.streams.video[0])
        for packet in source.demux(video=0):
            if packet.dts is not None:
                packet.stream = stream
                sink.mux(packet)
    for file in (path, other):
        with VideoFile(VideoFileOptions(file=file)) as source_:
            assert "variable frame rate" in source_.info.notes[0]
    assert [f.t_ns // 1_000_000 for f in frames_of(other)] == times_ms


@pytest.mark.parametrize(("rotation", "red"), [(0, (0, 0)), (90, (-1, 0)), (180, (-1, -1)), (-90, (0, -1))])
def test_the_rotation_tag_turns_the_pictures_and_is_noted(
    rotation: int, red: tuple[int, int], tmp_path: Path
) -> None:
    path = encode(tmp_path / "v.mp4", numbered(4), [0, 40, 80, 120], codec="h264", rotation=rotation)
    with VideoFile(VideoFileOptions(file=path)) as source:
        frame = source.read(0)
        assert frame is not None
        assert frame.image.shape == ((64, 96, 3) if rotation % 180 == 0 else (96, 64, 3))
        assert frame.image[red].argmax() == 2
        assert frame.image[red].max() > 150
        assert [note for note in source.info.notes if "rotation tag" in note] == (
            [] if rotation == 0 else ["v.mp4: turned or mirrored as its rotation tag says"]
        )


@pytest.mark.parametrize(("codec", "suffix"), [(c, s) for c, s in _EACH if s in {".mkv", ".webm"}])
def test_a_file_cut_short_is_refused_or_used_as_far_as_it_goes(
    codec: str, suffix: str, tmp_path: Path
) -> None:
    rng = np.random.default_rng(1)
    pictures = [rng.integers(0, 255, (64, 96, 3)).astype(np.uint8) for _ in range(40)]
    path = encode(tmp_path / f"v{suffix}", pictures, [33 * k for k in range(40)], codec=codec)
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
    with pytest.raises(RecordingError, match=rf"v\{suffix}: \d+ frames decode.*--allow-truncated"):
        frames_of(path)
    assert 5 < len(frames_of(path, allow_truncated=True)) < 40


@pytest.mark.parametrize("n_bytes", [1500, 3000, 6000])
def test_an_avi_that_lost_its_last_frames_is_refused(n_bytes: int, tmp_path: Path) -> None:
    path = write_video(tmp_path / "v.avi", 30)
    path.write_bytes(path.read_bytes()[:-n_bytes])
    with pytest.raises(
        RecordingError, match=r"(header says 30: |the last of them in part: ).*--allow-truncated"
    ):
        frames_of(path)


def test_frames_left_out_of_an_avi_are_none_that_are_missing(tmp_path: Path) -> None:
    times_ms = [0, 40, 200, 240, 600, 640]
    frames = frames_of(encode(tmp_path / "v.avi", numbered(6), times_ms, codec="mjpeg"))
    assert [f.t_ns / 1e6 for f in frames] == pytest.approx(times_ms, abs=0.5)


def test_a_file_of_which_nothing_decodes_is_refused(tmp_path: Path) -> None:
    path = encode(tmp_path / "v.mp4", numbered(30), [33 * k for k in range(30)], codec="av1")
    with av.open(str(path)) as container:
        places = [(packet.pos, packet.size) for packet in container.demux(video=0) if packet.size]
    data = bytearray(path.read_bytes())
    for at, n in places:
        assert at is not None
        data[at : at + n] = b"\xff" * n
    path.write_bytes(data)
    with pytest.raises(RecordingError, match=r"v\.mp4: none of its 30 frames can be decoded"):
        frames_of(path)
    with pytest.raises(RecordingError, match="none of its 30 frames"):
        next(read_pictures(path))


def test_playlists_and_text_are_no_videos(tmp_path: Path) -> None:
    secret = encode(tmp_path / "secret.mp4", numbered(4), [0, 40, 80, 120], codec="h264")
    for name, text in (
        ("a.m3u8", f"#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nfile://{secret}\n#EXT-X-ENDLIST\n"),
        ("b.mp4", f"ffconcat version 1.0\nfile '{secret}'\n"),
        ("c.txt", "hello\n" * 100),
    ):
        (tmp_path / name).write_text(text)
        with pytest.raises(RecordingError, match=f"{name}: cannot be opened as a video"):
            frames_of(tmp_path / name)


def test_a_raw_stream_names_the_way_out(tmp_path: Path) -> None:
    path = encode(tmp_path / "v.h264", numbered(4), [0, 40, 80, 120], codec="h264")
    with pytest.raises(RecordingError, match=r"states no frame times; .*ffmpeg -framerate RATE -i v\.h264"):
        frames_of(path)
