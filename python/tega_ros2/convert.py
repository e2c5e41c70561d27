"""Convert messages of a recording or run to ROS 2: viewers' schemas to standard messages, own ones field by field."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple

import numpy as np

from tega.errors import RecordingError
from tega.recording.mcap_reader import Message
from tega_ros2.definitions import SCALARS, VIDEO, Definitions

_S: Final = 1_000_000_000
_LOG_LEVELS: Final = (0, 10, 20, 30, 40, 50)
_STANDARD: Final = {
    "foxglove.RawImage": "sensor_msgs/msg/Image",
    "foxglove.CompressedImage": "sensor_msgs/msg/CompressedImage",
    "foxglove.CompressedVideo": VIDEO,
    "foxglove.JointStates": "sensor_msgs/msg/JointState",
    "foxglove.PoseInFrame": "geometry_msgs/msg/PoseStamped",
    "foxglove.FrameTransform": "geometry_msgs/msg/TransformStamped",
    "foxglove.Log": "rcl_interfaces/msg/Log",
}
"""Standard message for each of the viewers' schemas."""


class Converted(NamedTuple):
    """One ROS 2 message; ``kind`` is its type, as ``sensor_msgs/msg/JointState``, ``value`` rosbags' own."""

    topic: str
    kind: str
    value: Any


class Converter:
    """Converts the messages of one recording or run.

    ``definitions`` are the message types that were used so far; a run that has just begun sets ``epoch_ns``
    with its first record.
    """

    def __init__(self, source: str, epoch_ns: int) -> None:
        self._source, self.epoch_ns = source, epoch_ns
        self.definitions = Definitions(source)
        self._types: dict[str, Any] = self.definitions.store.types

    def convert(self, message: Message) -> list[Converted]:
        """Return the ROS 2 messages of a message: itself, then those that standard tools show beside it."""
        standard = _STANDARD.get(message.schema)
        if standard is not None:
            return [Converted(message.topic, standard, self._made(standard, self._fields(message)))]
        if not message.schema.startswith("tega.") or message.value is None:
            raise RecordingError(
                f"{self._source}: {message.topic}: {message.schema!r} has no form in ROS 2",
                "export it as csv",
            )
        kind = self.definitions.own(message.value.DESCRIPTOR)
        stamp = self._time(self._own_ns(message))
        header = self._types["std_msgs/msg/Header"](stamp=stamp, frame_id=_finger(message.topic))
        own = Converted(message.topic, kind, self._own(message.value, kind, header=header))
        return [own, *self._beside(message, header)]

    def _own_ns(self, message: Message) -> int:
        # A hand's exchanges are stamped by the machine's monotonic clock.
        if message.schema == "tega.HandExchange" or not hasattr(message.value, "t_ns"):
            return message.log_ns
        return self.epoch_ns + int(message.value.t_ns)

    def _beside(self, message: Message, header: Any) -> list[Converted]:
        """Return the standard messages of the numbers that plots and other programs use."""
        value, topic, fields = message.value, message.topic, dict[str, Any]()
        match message.schema:
            case "tega.Contact" if value.HasField("force_n"):
                # The axis z of the frame points into the finger, so that a press is positive.
                force, none = {"x": 0.0, "y": 0.0, "z": value.force_n}, dict.fromkeys("xyz", 0.0)
                pad = {"stamp": header.stamp, "frame_id": f"{_finger(topic)}_pad"}
                place, kind = topic.removesuffix("contact") + "wrench", "geometry_msgs/msg/WrenchStamped"
                fields = {"header": pad, "wrench": {"force": force, "torque": none}}
            case "tega.Levels" if topic == "/emg/levels" and value.HasField("closure"):
                place, kind, fields = "/emg/closure", "std_msgs/msg/Float64", {"data": value.closure}
            case "tega.EmgSamples" if value.n_channels > 0:
                place, kind = f"{topic}/array", "std_msgs/msg/Float64MultiArray"
                n, n_channels = len(value.samples) // value.n_channels, value.n_channels
                sizes = (("sample", n, n * n_channels), ("channel", n_channels, n_channels))
                dims = [self._types["std_msgs/msg/MultiArrayDimension"](*size) for size in sizes]
                data = np.array(value.samples[: n * n_channels], np.float64)
                fields = {"layout": {"dim": dims, "data_offset": 0}, "data": data}
            case "tega.State":
                place, kind, fields = f"{topic}/text", "std_msgs/msg/String", {"data": value.state}
            case _:
                return []
        return [Converted(place, kind, self._made(kind, fields))]

    def _own(self, value: Any, kind: str, /, **header: Any) -> Any:
        fields: dict[str, Any] = {}
        for field in value.DESCRIPTOR.fields:
            content = getattr(value, field.name)
            if field.message_type is not None:
                part = self.definitions.own(field.message_type, header=False)
                many = [self._own(one, part) for one in (content if field.is_repeated else [content])]
                fields[field.name] = many if field.is_repeated else many[0]
            elif field.is_repeated:
                of = SCALARS[field.type]
                fields[field.name] = list(content) if of == "string" else np.array(content, of)
            elif isinstance(content, bytes):
                fields[field.name] = np.frombuffer(content, np.uint8)
            else:
                fields[field.name] = content
            if not field.is_repeated and field.has_presence:
                there = value.HasField(field.name)
                fields[f"has_{field.name}"] = there
                if not there and isinstance(content, float):
                    fields[field.name] = math.nan
        return self._types[kind](**header, **fields)

    def _made(self, kind: str, fields: Mapping[str, Any]) -> Any:
        """Return a message of its fields; a field that is a message is a dictionary of its own fields."""
        kinds = dict(self.definitions.store.fielddefs[kind][1])
        made = {
            name: self._made(kinds[name][1], one) if isinstance(one, dict) else one
            for name, one in fields.items()
        }
        return self._types[kind](**made)

    def _time(self, t_ns: int) -> Any:
        seconds, rest_ns = divmod(t_ns, _S)
        if not 0 <= seconds < 2**31:
            raise RecordingError(
                f"{self._source}: a time of {seconds} s since 1970; ROS 2 has 0 to {2**31 - 1} s",
                "inspect the recording: one of its times is wrong",
            )
        return self._types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=rest_ns)

    def _fields(self, message: Message) -> dict[str, Any]:
        value = message.value
        stamp = self._time(value.timestamp.seconds * _S + value.timestamp.nanos)
        frame = getattr(value, "frame_id", "") or getattr(value, "parent_frame_id", "")
        fields: dict[str, Any] = {"header": {"stamp": stamp, "frame_id": frame}}
        match message.schema:
            case "foxglove.RawImage":
                fields |= _named(value, ("height", "width", "encoding", "step"))
                fields |= {"is_bigendian": 0, "data": np.frombuffer(value.data, np.uint8)}
            case "foxglove.CompressedImage":
                fields |= {"format": value.format, "data": np.frombuffer(value.data, np.uint8)}
            case "foxglove.CompressedVideo":
                fields = {"timestamp": stamp, "frame_id": frame, "format": value.format}
                fields["data"] = np.frombuffer(value.data, np.uint8)
            case "foxglove.JointStates":
                fields["name"] = [joint.name for joint in value.joints]
                fields["position"] = np.array([joint.position for joint in value.joints], np.float64)
                fields |= {"velocity": np.empty(0), "effort": np.empty(0)}
            case "foxglove.PoseInFrame":
                place, turn = _named(value.pose.position, "xyz"), _named(value.pose.orientation, "xyzw")
                fields["pose"] = {"position": place, "orientation": turn}
            case "foxglove.FrameTransform":
                place, turn = _named(value.translation, "xyz"), _named(value.rotation, "xyzw")
                fields["child_frame_id"] = value.child_frame_id
                fields["transform"] = {"translation": place, "rotation": turn}
            case _:
                level = _LOG_LEVELS[value.level] if 0 <= value.level < len(_LOG_LEVELS) else 0
                fields = {"stamp": stamp, "level": level, "msg": value.message, "function": ""}
                fields |= _named(value, ("name", "file", "line"))
        return fields


def _named(value: Any, names: Iterable[str]) -> dict[str, Any]:
    return {name: getattr(value, name) for name in names}


def _finger(topic: str) -> str:
    """Return the finger that a topic names, ``""`` for none."""
    return topic.split("/")[2] if topic.startswith("/tactile/") else ""
