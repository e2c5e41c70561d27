"""The built-in drivers at their edges; what all drivers share is in tests/tega_sim/test_drivers.py."""

from __future__ import annotations

import shutil
import struct
import sys
import zlib
from collections.abc import Callable
from pathlib import Path

import can
import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference.installed import distribution
from reference.recordings import pressed, write_folder, write_video
from tega.devices import driver_class, list_drivers
from tega.devices.fingertip.digit import Digit, DigitOptions
from tega.devices.fingertip.images import ImageFolder, ImageFolderOptions
from tega.devices.fingertip.video import VideoFile, VideoFileOptions
from tega.devices.hand.python_can import PythonCan, PythonCanOptions
from tega.devices.table_recorder import TableRecorderOptions
from tega.devices.vest.vest_recorder import VestRecorder
from tega.errors import ConfigError, DeviceUnavailableError, MissingExtraError, RecordingError
from tega.haptics import vest_frame
from tega.runtime.opencv import decode_image
from tega.wire import CanFrame


def names_read(folder: Path, **options: object) -> list[str]:
    with ImageFolder(ImageFolderOptions(folder=folder, **options)) as source:  # type: ignore[arg-type]
        return [frame.name for frame in iter(lambda: source.read(0), None)]


def test_pictures_come_in_natural_order_and_nothing_else_comes(tmp_path: Path) -> None:
    for name in ("frame_10.png", "frame_9.PNG", "Frame_1.jpg", "a2.bmp", ".hidden.png", "gel.png"):
        cv2.imwrite(str(tmp_path / name), pressed(0, noise=0))
    (tmp_path / "notes.csv").write_text("1,2")
    (tmp_path / "sub.png").mkdir()
    read = names_read(tmp_path, exclude=(tmp_path / "gel.png",))
    assert read == ["a2.bmp", "Frame_1.jpg", "frame_9.PNG", "frame_10.png"]


@pytest.mark.parametrize(
    ("suffix", "cut", "text"),
    [
        (".png", 0.5, "PNG cut short"),
        (".png", 0.999, "PNG cut short"),
        (".jpg", 0.5, "JPEG cut short: .* no end-of-image"),
        (".bmp", 0.5, r"BMP cut short: \d+ bytes of \d+"),
        (".webp", 0.5, r"WebP cut short: \d+ bytes of \d+"),
        (".tiff", 0.5, "not a picture that can be decoded"),
        (".png", 0.0, r"not a picture that can be decoded \(0 bytes\)"),
    ],
)
def test_a_picture_cut_short_is_refused_and_named(tmp_path: Path, suffix: str, cut: float, text: str) -> None:
    path = tmp_path / f"frame_3{suffix}"
    cv2.imwrite(str(path), pressed(50, noise=1))
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * cut)])
    with pytest.raises(RecordingError, match=rf"frame_3\{suffix}: {text}"):
        names_read(tmp_path)


@pytest.mark.parametrize(
    ("size", "text"),
    [((20_000, 20_000), "20000x20000 pixels"), ((8000, 8000), "bytes cannot hold 8000x8000 pixels")],
)
def test_a_forged_size_asks_for_no_memory(tmp_path: Path, size: tuple[int, int], text: str) -> None:
    path = write_folder(tmp_path, 1) / "frame_0.png"
    data = bytearray(path.read_bytes())
    data[16:24] = struct.pack(">II", *size)
    data[29:33] = struct.pack(">I", zlib.crc32(data[12:29]))
    path.write_bytes(data)
    with pytest.raises(RecordingError, match=text):
        names_read(tmp_path)


def test_a_stray_picture_among_the_frames_is_no_frame_and_told(tmp_path: Path) -> None:
    folder = write_folder(tmp_path, 12)
    shutil.copy(folder / "frame_3.png", folder / "IMG_2041 copy.png")
    with ImageFolder(ImageFolderOptions(folder=folder)) as source:
        (note,) = source.info.notes
        assert source.info.n_items == 12
    assert note.startswith("IMG_2041 copy.png: not named as the 12 other pictures (frame_#)")
    assert "IMG_2041 copy.png" not in names_read(folder)
    (folder / "IMG_2041 copy.png").rename(folder / "frame_12.png")
    assert len(names_read(folder)) == 13


def test_a_camera_that_cannot_be_reached_is_not_blamed_on_permissions() -> None:
    with pytest.raises(DeviceUnavailableError, match="does not open") as caught:
        Digit(DigitOptions(source="http://127.0.0.1:9/stream")).open()
    assert "is the address right" in caught.value.hint
    assert "udev" not in caught.value.hint


@given(data=st.data())
def test_a_changed_png_gives_the_same_pixels_or_none(data: st.DataObject) -> None:
    picture = pressed(50, noise=1)
    file = bytearray(cv2.imencode(".png", picture)[1].tobytes())
    file[data.draw(st.integers(0, len(file) - 1))] ^= data.draw(st.integers(1, 255))
    try:
        read = decode_image(bytes(file), "frame_0.png", driver="image-folder")
    except RecordingError:
        return
    np.testing.assert_array_equal(read, picture)


def test_folders_that_are_no_recording_are_told_apart(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="nowhere: no such folder"):
        names_read(tmp_path / "nowhere")
    with pytest.raises(RecordingError, match="holds no picture"):
        names_read(tmp_path)
    write_folder(tmp_path, 2)
    cv2.imwrite(str(tmp_path / "frame_2.png"), np.zeros((20, 30, 3), np.uint8))
    with pytest.raises(RecordingError, match=r"frame_2\.png: 30×20 pixels, the frames before it have 80×60"):
        names_read(tmp_path)


def test_a_video_has_its_headers_rate_and_length(tmp_path: Path) -> None:
    with VideoFile(VideoFileOptions(file=write_video(tmp_path / "v.avi", 7, rate_hz=25))) as source:
        assert (source.info.rate_hz, source.info.n_items) == (25.0, 7)
        frames = [source.read(0) for _ in range(7)]
        assert [f.t_ns for f in frames if f] == [k * 40_000_000 for k in range(7)]
        assert source.ended


def test_a_truncated_video_is_noted_if_it_is_allowed(tmp_path: Path) -> None:
    path = write_video(tmp_path / "cut.avi", 40)
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
    with VideoFile(VideoFileOptions(file=path, allow_truncated=True)) as source:
        n = sum(source.read(0) is not None for _ in range(40))
        assert 20 <= n < 40
        assert source.info.n_items == n
        assert f"{n + 1} frames decode, its header says 40" in source.info.notes[0]


@pytest.mark.parametrize("content", [b"", b"not a video", b"RIFF\x00\x00\x00\x00AVI LIST"])
def test_what_is_no_video_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "v.mp4"
    path.write_bytes(content)
    message = rf"v\.mp4: cannot be opened as a video \({len(content)} bytes\)"
    with pytest.raises(RecordingError, match=message):
        VideoFile(VideoFileOptions(file=path)).open()
    picture = write_folder(tmp_path, 1) / "frame_0.png"
    with pytest.raises(RecordingError, match=r"frame_0\.png: a picture, not a video; give the folder"):
        VideoFile(VideoFileOptions(file=picture)).open()
    with pytest.raises(RecordingError, match=r"none\.mp4: no such video"):
        VideoFile(VideoFileOptions(file=tmp_path / "none.mp4")).open()


def test_can_frames_reach_the_bus_with_standard_identifiers() -> None:
    frames = [CanFrame(0x180, bytes(range(8))), CanFrame(0x200, b"", remote=True), CanFrame(0x104, b"")]
    with (
        can.Bus(interface="virtual", channel="hand") as listener,
        PythonCan(PythonCanOptions(channel="hand")) as hand,
    ):
        hand.write(0, frames)
        got = [listener.recv(1.0) for _ in frames]
    assert [(m.arbitration_id, bytes(m.data), m.is_remote_frame) for m in got if m] == [
        tuple(f) for f in frames
    ]
    assert not any(m.is_extended_id or m.is_fd for m in got if m)


def test_torques_of_a_model_do_not_reach_hardware_unasked() -> None:
    with pytest.raises(ConfigError, match=r"interface 'socketcan' may have a real hand behind it.*open_loop"):
        PythonCan(PythonCanOptions(interface="socketcan", channel="can0")).open()


def test_the_vest_recorder_names_motors_by_their_index(tmp_path: Path) -> None:
    path = tmp_path / "vest.csv"
    with VestRecorder(TableRecorderOptions(file=path)) as vest:
        vest.write(33_333_333, vest_frame([1, 2, 3, 4], [5, 6, 7, 8], layout="x16"))
        with pytest.raises(DeviceUnavailableError, match="40 motors after frames for 16"):
            vest.write(66_666_667, vest_frame([0] * 4, [0] * 4, layout="x40"))
    header, row = path.read_text().splitlines()
    assert header == "t_s,m0,m1,m2,m3,m8,m9,m10,m11,m20,m21,m22,m23,m28,m29,m30,m31"
    assert row == "0.033333,1,2,3,4,1,2,3,4,5,6,7,8,5,6,7,8"


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str], None]:
    """Return a function that puts a package with the driver ``own`` where Python looks for packages."""

    def installed(module: str, source: str) -> None:
        (tmp_path / f"{module}.py").write_text(source)
        monkeypatch.syspath_prepend(
            distribution(tmp_path, module, f"[tega.devices]\nown = {module}:Driver\n")
        )

    return installed


def test_a_strangers_driver_comes_through_the_same_door(install: Callable[[str, str], None]) -> None:
    source = "from tega.devices.vest.vest_recorder import VestRecorder\nclass Driver(VestRecorder):\n"
    install("tega_test_vest", f"{source}    summary = 'mine'\n")
    assert driver_class("own", "vest").summary == "mine"
    record = next(r for r in list_drivers() if r.name == "own")
    assert (record.kind, record.package, record.ready) == ("vest", "tega_test_vest", True)


def test_a_driver_whose_package_is_missing_names_it(install: Callable[[str, str], None]) -> None:
    install("tega_test_needy", "import no_such_package_here\n")
    with pytest.raises(MissingExtraError, match=r"driver 'own' needs 'no_such_package_here'"):
        driver_class("own")
    record = next(r for r in list_drivers() if r.name == "own")
    assert not record.ready
    assert "no_such_package_here" in record.problem


@pytest.mark.parametrize("source", ["", "Driver = 3\n", "class Driver:\n    pass\n"])
def test_an_entry_that_holds_no_driver_says_so(source: str, install: Callable[[str, str], None]) -> None:
    module = f"tega_test_hollow{len(source)}"
    install(module, source)
    with pytest.raises(DeviceUnavailableError, match=rf"'own' is registered as '{module}:Driver', which"):
        driver_class("own")


def test_a_package_missing_at_opening_names_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "can", None)
    message = r"'python-can' needs the package 'can'.*pip install 'tega\[lab\]'"
    with pytest.raises(MissingExtraError, match=message):
        PythonCan(PythonCanOptions()).open()
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'tega\[lab\]'"):
        ImageFolder(ImageFolderOptions(folder=tmp_path)).open()
