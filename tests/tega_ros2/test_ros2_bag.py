"""Recordings of other programs: ROS 2 bags as fingertips and EMG, and what TEGA says of a file that is not its own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import Writer as McapWriter

from reference.command import call
from reference.recordings import pressed, squeezes
from reference.ros2 import BEGIN_NS, array, compressed, raw, write_bag
from tega.errors import RecordingError
from tega_ros2.bag_emg import Ros2Emg, Ros2EmgOptions
from tega_ros2.bag_pictures import Ros2Pictures, Ros2PicturesOptions

_FEW = settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def frames_of(path: Path, topic: str = "") -> list[Any]:
    with Ros2Pictures(Ros2PicturesOptions(file=path, topic=topic)) as source:
        found = list(iter(lambda: source.read(0), None))
        assert source.ended
    return found


def emg_of(path: Path, **options: Any) -> tuple[Any, Any, Any]:
    with Ros2Emg(Ros2EmgOptions(file=path, **options)) as source:
        chunks: list[Any] = list(iter(lambda: source.read(0), None))
        return np.concatenate([chunk.samples for chunk in chunks]), chunks, source.info


@_FEW
@given(
    encoding=st.sampled_from(["bgr8", "rgb8", "bgra8", "mono8", ""]),
    pad=st.integers(0, 7),
    steps_ms=st.lists(st.integers(1, 300), min_size=1, max_size=8),
    seed=st.integers(0, 99),
)
def test_pictures_of_a_topic_come_as_they_were_written(
    encoding: str, pad: int, steps_ms: list[int], seed: int, tmp_path: Path
) -> None:
    times = np.cumsum([0, *steps_ms]) * 1_000_000
    pictures = np.random.default_rng(seed).integers(0, 256, (len(times), 12, 10, 3)).astype(np.uint8)
    messages = [("/other", "array", BEGIN_NS - 250_000_000, array(np.zeros(3, np.float32)))]
    for picture, t_ns in zip(pictures, times.tolist(), strict=True):
        stamp_ns = BEGIN_NS - 40_000_000 + t_ns  # the camera's clock is another
        message = raw(picture, encoding, stamp_ns, pad) if encoding else compressed(picture, stamp_ns)
        # Transport is late by some milliseconds, once more, once less.
        log_ns = BEGIN_NS + t_ns + (t_ns // 1_000_000 % 3) * (t_ns > 0) * 100_000
        messages.append(("/gel", "image" if encoding else "compressed", log_ns, message))
    frames = frames_of(write_bag(tmp_path / "a.mcap", messages))
    assert [f.t_ns for f in frames] == [250_000_000 + t for t in times]
    right = np.repeat(pictures[..., :1], 3, axis=3) if encoding == "mono8" else pictures
    np.testing.assert_array_equal([f.image for f in frames], right)


@_FEW
@given(
    layout=st.sampled_from([(), ("samples", "channels"), ("channels", "samples")]),
    n_channels=st.integers(1, 5),
    n_messages=st.integers(3, 20),
    seed=st.integers(0, 99),
)
def test_arrays_of_a_topic_are_samples(
    layout: tuple[str, ...], n_channels: int, n_messages: int, seed: int, tmp_path: Path
) -> None:
    n_each = 10 if layout else 1
    samples = np.random.default_rng(seed).normal(size=(n_messages, n_each, n_channels)).astype(np.float32)
    messages = []
    for k, part in enumerate(samples):
        table = part.T if layout[:1] == ("channels",) else part
        messages.append(("/emg", "array", BEGIN_NS + (k + 1) * n_each * 5_000_000, array(table, layout)))
    found, chunks, info = emg_of(write_bag(tmp_path / "a.mcap", messages))
    np.testing.assert_array_equal(found, samples.reshape(-1, n_channels).astype(np.float64))
    assert info.rate_hz == pytest.approx(200)
    assert info.notes == ()
    assert chunks[-1].t_ns == pytest.approx(len(found) * 5_000_000, abs=n_each * 5_000_000)


def test_a_rate_that_differs_and_gaps_are_noted(tmp_path: Path) -> None:
    messages = [
        ("/emg", "array", BEGIN_NS + (k + 100 * (k > 20)) * 5_000_000, array(np.ones(2, np.float32)))
        for k in range(40)
    ]
    _, _, info = emg_of(write_bag(tmp_path / "a.mcap", messages), rate_hz=1000)
    assert info.notes == (
        "the messages' times say 200 samples per second, 1000 is used",
        "1 gaps, the longest 0.505 s: samples are missing, and later ones come early",
    )


def test_a_topic_that_does_not_fit_is_refused_with_those_there_are(tmp_path: Path) -> None:
    picture = pressed(0, noise=1)
    messages = [(topic, "image", BEGIN_NS, raw(picture, "bgr8", BEGIN_NS)) for topic in ("/a", "/b")]
    path = write_bag(tmp_path / "a.mcap", messages)
    with pytest.raises(
        RecordingError, match=r"2 topics have pictures; its topics: /a sensor_msgs/msg/Image \(1\), /b"
    ):
        frames_of(path)
    with pytest.raises(RecordingError, match="topic '/c' is none with pictures"):
        frames_of(path, "/c")
    assert len(frames_of(path, "/b")) == 1
    with pytest.raises(RecordingError, match=r"0 topics have arrays of numbers; .* tega-teleop verify"):
        emg_of(path)


def test_an_encoding_that_is_not_read_is_named(tmp_path: Path) -> None:
    message = raw(pressed(0, noise=1), "bgr8", BEGIN_NS) | {"encoding": "16UC1"}
    path = write_bag(tmp_path / "a.mcap", [("/a", "image", BEGIN_NS, message)])
    with pytest.raises(RecordingError, match="pictures encoded as '16UC1' are not read"):
        frames_of(path)


def test_a_bag_is_replayed_as_fingertip_and_emg(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tega.ui.view.course.SessionPicture.write", lambda *_given, **_more: None)
    messages: list[Any] = []
    for k in range(30):
        t_ns = BEGIN_NS + k * 16_666_667
        messages.append(("/gel", "compressed", t_ns, compressed(pressed(60 * (k > 15), noise=k), t_ns)))
    for k, row in enumerate(squeezes(100, 200.0)):
        messages.append(("/emg", "array", BEGIN_NS + k * 5_000_000, array(row.astype(np.float32))))
    bag = tmp_path / "bag"
    bag.mkdir()
    write_bag(bag / "bag_0.mcap", sorted(messages, key=lambda one: one[2]))
    out, _ = call(
        capsys, "replay", "--json", "--tactile", f"thumb={bag}", "--topic", "thumb=/gel", "--emg", bag / "bag_0.mcap",
        "--topic", "emg=/emg", "--emg-kind", "raw", "--out", tmp_path / "out",
    )  # fmt: skip
    assert '"frames": 30' in out
    (bag / "bag_0.mcap").rename(bag / "bag_0.db3")
    (bag / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
    _, text = call(capsys, "replay", "--tactile", f"thumb={bag}", "--out", tmp_path / "out", code=1)
    assert "a bag in SQLite" in text


@pytest.mark.parametrize(
    "words",
    [
        ("recording", "inspect"),
        ("verify",),
        ("recording", "export", "--out", "tables"),
        ("recording", "trim", "--to", "1", "--out", "cut.mcap"),
        ("recording", "encode", "--out", "coded"),
        ("recording", "merge", "--out", "merged.mcap"),
    ],
)
def test_a_file_of_another_program_is_named_with_its_topics(
    words: tuple[str, ...],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    bag = write_bag(tmp_path / "a.mcap", [("/emg", "array", BEGIN_NS, array(np.zeros(3, np.float32)))])
    other, empty = tmp_path / "b.mcap", tmp_path / "c.mcap"
    with other.open("wb") as file:
        writer: Any = McapWriter(file)
        writer.start(profile="", library="somebody")
        number = writer.register_channel("/x", "json", writer.register_schema("Y", "jsonschema", b"{}"))
        writer.add_message(number, 5, b"{}", 5)
        writer.finish()
    empty.write_bytes(b"")
    for path, said in (
        (bag, "not recorded by TEGA (profile ros2); its topics: /emg std_msgs/msg/Float32MultiArray (1)"),
        (other, "not recorded by TEGA (written by somebody); its topics: /x Y (1)"),
        (empty, "is empty (0 bytes)"),
    ):
        _, text = call(capsys, *words, path, *([path] if "merge" in words else []), code=1)
        assert said in text
