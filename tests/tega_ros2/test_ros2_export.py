# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""Every value of a recording is in the ROS 2 bag that is made of it, by two readers that others have written."""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("rosbags", reason="needs the extra ros2")
pytest.importorskip("mcap_ros2", reason="needs the extra ros2")

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader
from ruamel.yaml import YAML

from reference.command import call
from reference.record_strategies import records_of
from reference.ros2 import in_time
from reference.sessions import messages, rewritten
from tega.errors import RecordingError
from tega.hand import JOINT_NAMES
from tega.recording.mcap_reader import McapReader, Message, read_picture
from tega.records import RECORDS, Contact, Intent, Record
from tega_ros2.bag_emg import Ros2Emg, Ros2EmgOptions
from tega_ros2.definitions import Definitions
from tega_ros2.outputs import export_bag
from together.property.test_records import recorded

_each = st.tuples(*map(records_of, RECORDS))
_S = 10**9
# Beside a record's own topic.
EXTRA = ("/wrench", "/emg/closure", "/emg/samples/array", "/run/state/text")


def by_rosbags(bag: Path) -> list[tuple[str, int, str, Any]]:
    """Return topic, log time, type and message by rosbags, whose types are those that the bag defines."""
    with AnyReader([bag]) as reader:
        return [
            (connection.topic, t_ns, connection.msgtype, reader.deserialize(raw, connection.msgtype))
            for connection, t_ns, raw in reader.messages()
        ]


def by_mcap(bag: Path) -> list[tuple[str, int, str, Any]]:
    """Return the same by mcap-ros2-support."""
    with next(bag.glob("*.mcap")).open("rb") as file:
        found = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages()
        return [(c.topic, m.log_time, s.name if s else "", value) for s, c, m, value in found]


def plain(value: Any) -> Any:
    """Return a message as lists and numbers, whichever reader it comes from."""
    if isinstance(value, np.ndarray):
        return value.tobytes() if value.dtype == np.uint8 else value.tolist()
    if isinstance(value, bytearray | memoryview):
        return bytes(value)
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    names = getattr(value, "__dataclass_fields__", None) or getattr(value, "__slots__", None)
    if not names:
        return value
    return {
        name: plain(getattr(value, name)) for name in names if name == name.lower() and name != "__msgtype__"
    }


def of_protobuf(value: Any, header: dict[str, Any] | None = None) -> dict[str, Any]:
    """Return what a message of TEGA's own is to be, from the protobuf message alone."""
    found: dict[str, Any] = {} if header is None else {"header": header}
    for field in value.DESCRIPTOR.fields:
        content = getattr(value, field.name)
        if field.is_repeated:
            parts = field.message_type is not None
            found[field.name] = [of_protobuf(one) if parts else one for one in content]
            continue
        found[field.name] = content
        if field.has_presence:
            there = found[f"has_{field.name}"] = value.HasField(field.name)
            if not there and isinstance(content, float):
                found[field.name] = math.nan
    return found


def stamp(t_ns: int) -> dict[str, int]:
    return {"sec": t_ns // _S, "nanosec": t_ns % _S}


def axes(value: Any, names: str) -> dict[str, float]:
    return {axis: getattr(value, axis) for axis in names}


def expected(message: Message, epoch_ns: int) -> Any:
    """Return what a message is to be in the bag."""
    value, finger = message.value, message.topic.split("/")[2] if message.topic.startswith("/tactile") else ""
    if message.schema.startswith("tega."):
        logged = message.schema == "tega.HandExchange" or "t_ns" not in value.DESCRIPTOR.fields_by_name
        t_ns = message.log_ns if logged else epoch_ns + value.t_ns
        return of_protobuf(value, {"stamp": stamp(t_ns), "frame_id": finger})
    at = stamp(value.timestamp.seconds * _S + value.timestamp.nanos)
    frame = getattr(value, "frame_id", "") or getattr(value, "parent_frame_id", "")
    header: dict[str, Any] = {"header": {"stamp": at, "frame_id": frame}}
    match message.schema:
        case "foxglove.RawImage":
            image = read_picture(message)
            size = {"height": image.shape[0], "width": image.shape[1], "step": 3 * image.shape[1]}
            fields: dict[str, Any] = size | {"encoding": "bgr8", "is_bigendian": 0, "data": image.tobytes()}
        case "foxglove.JointStates":
            angles = [joint.position for joint in value.joints]
            fields = {"name": list(JOINT_NAMES), "position": angles, "velocity": [], "effort": []}
        case "foxglove.PoseInFrame":
            place, turn = axes(value.pose.position, "xyz"), axes(value.pose.orientation, "xyzw")
            fields = {"pose": {"position": place, "orientation": turn}}
        case "foxglove.FrameTransform":
            transform = {"translation": dict.fromkeys("xyz", 0.0), "rotation": axes(value.rotation, "xyzw")}
            fields = {"child_frame_id": value.child_frame_id, "transform": transform}
        case "foxglove.Log":
            texts = {"name": value.name, "msg": value.message, "file": value.file, "function": ""}
            header, fields = {}, {"stamp": at, "level": 10 * value.level, **texts, "line": value.line}
        case _:
            assert message.schema == "foxglove.CompressedVideo"
            header, fields = (
                {},
                {"timestamp": at, "frame_id": frame, "data": value.data, "format": value.format},
            )
    return header | fields


def same(one: Any, other: Any) -> bool:
    """Whether two plain messages are equal, every NaN like another."""
    first, second = (json.dumps(message, sort_keys=True, default=repr) for message in (one, other))
    return first == second


def compared(recording: Path, bag: Path) -> Iterator[tuple[Message, list[tuple[str, str, Any]]]]:
    """Compare every message; yield each with what stands beside it in the bag."""
    reader = McapReader(recording)
    whole = [read(bag) for read in (by_rosbags, by_mcap)]
    both = [[item for item in found if not _extra(item[0])] for found in whole]
    extras = [[item for item in found if _extra(item[0])] for found in whole]
    # Readers sort by time, and messages of one time may change places.
    messages = sorted(reader.messages(), key=lambda message: (message.log_ns, message.topic))
    for found in both:
        found.sort(key=lambda item: (item[1], item[0]))
        assert len(found) == len(messages)
    epoch_ns = int(reader.metadata["tega"]["epoch_ns"])
    for message, *items in zip(messages, *both, strict=True):
        wanted = expected(message, epoch_ns)
        for topic, log_ns, _, value in items:
            assert (topic, log_ns) == (message.topic, message.log_ns)
            assert same(plain(value), wanted), (topic, plain(value), wanted)
        beside = [
            [(topic, kind, plain(value)) for topic, log_ns, kind, value in found if log_ns == message.log_ns]
            for found in extras
        ]
        yield message, beside[0] + beside[1]


def _extra(topic: str) -> bool:
    return topic.endswith(EXTRA)


@settings(max_examples=settings().max_examples // 15)  # of each record one
@given(records=_each)
def test_a_record_of_every_kind_is_in_the_bag_with_every_value(records: tuple[Record, ...]) -> None:
    with tempfile.TemporaryDirectory() as name:
        path = recorded(Path(name) / "session", tuple(map(in_time, records)))
        bag = export_bag(path, Path(name) / "bag")
        assert {message.topic for message, _ in compared(path, bag)}


@given(force_n=st.floats(0, 50), closure=st.floats(0, 1))
@settings(max_examples=4)
def test_force_and_closure_are_standard_messages_too(force_n: float, closure: float) -> None:
    records = (
        Contact(finger="thumb", t_ns=10, in_contact=True, force_n=force_n),
        Contact(finger="ring", t_ns=20, taken_ns=20, in_contact=True),
        Intent(t_ns=30, taken_ns=30, level=3, closure=closure),
    )
    with tempfile.TemporaryDirectory() as name:
        path = recorded(Path(name) / "session", records)
        found = by_mcap(export_bag(path, Path(name) / "bag"))
    beside = {topic: (kind, plain(value)) for topic, _, kind, value in found if _extra(topic)}
    kind, wrench = beside.pop("/tactile/thumb/wrench")
    assert kind == "geometry_msgs/msg/WrenchStamped"
    assert wrench["wrench"]["force"] == {"x": 0.0, "y": 0.0, "z": force_n}
    assert wrench["header"]["frame_id"] == "thumb_pad"
    assert beside == {"/emg/closure": ("std_msgs/msg/Float64", {"data": closure})}


def test_a_session_is_a_bag_whose_types_name_units_and_which_replays(
    capsys, tmp_path: Path, short: Path
) -> None:
    out = tmp_path / "bags"
    printed, _ = call(capsys, "recording", "export", str(short), "--format", "ros2", "--out", str(out))
    bag = out / short.stem
    assert printed.split() == [str(bag)]
    kinds = {message.schema for message, _ in compared(short, bag)}
    assert {"tega.Contact", "tega.EmgSamples", "foxglove.RawImage", "foxglove.JointStates"} <= kinds
    with Reader(bag) as reader:
        contact = next(c for c in reader.connections if c.topic == "/tactile/thumb/contact")
        assert contact.msgtype == "tega_msgs/msg/Contact"
        assert "float64 force_n  # N\nbool has_force_n\n" in contact.msgdef.data
        assert contact.digest.startswith("RIHS01_")
    metadata = YAML(typ="safe").load(bag / "metadata.yaml")["rosbag2_bagfile_information"]
    assert (metadata["version"], metadata["storage_identifier"]) == (9, "mcap")
    assert json.loads(metadata["custom_data"]["tega.tega"])["format"] == "tega-recording"
    assert (bag / "attachments" / "session.toml").is_file()
    # What goes out comes in again by the own driver.
    emg = Ros2EmgOptions(file=bag, topic="/emg/samples/array", rate_hz=1000)
    samples = [m.value for m in McapReader(short).messages() if m.topic == "/emg/samples"]
    with Ros2Emg(emg) as muscles:
        chunks = [chunk.samples for chunk in iter(lambda: muscles.read(0), None)]
    wanted = np.concatenate([np.array(one.samples).reshape(-1, one.n_channels) for one in samples])
    np.testing.assert_array_equal(np.concatenate(chunks), wanted)


def test_a_time_that_ros_does_not_have_is_an_error_and_leaves_no_bag(tmp_path: Path, short: Path) -> None:
    def late(topic: str, value: Any) -> Any:
        if topic == "/emg/levels":
            value.t_ns = 2**62
        return value

    with pytest.raises(RecordingError, match="ROS 2 has 0 to 2147483647 s"):
        export_bag(rewritten(short, tmp_path / "late.mcap", late), tmp_path / "bag")
    assert not (tmp_path / "bag").exists()


def test_a_cut_recording_is_written_as_far_as_it_goes(tmp_path: Path, short: Path) -> None:
    cut = tmp_path / "cut.mcap"
    data = short.read_bytes()
    cut.write_bytes(data[: len(data) * 2 // 3])
    assert 0 < len(by_rosbags(export_bag(cut, tmp_path / "bag"))) < len(messages(short))


@pytest.mark.parametrize("name", ["Bad name", "header", "_x", "two__lines", "Öl"])
def test_a_name_that_ros_does_not_have_is_an_error(name: str) -> None:
    # A hostile schema; protobuf's own library refuses some of the names already.
    field = SimpleNamespace(name=name, message_type=None, type=1, is_repeated=False, has_presence=False)
    with pytest.raises(RecordingError, match="cannot be a message of ROS 2"):
        Definitions("file.mcap").own(SimpleNamespace(name="Thing", fields=[field]))
