"""Convert messages of a recording or run to ROS 2: viewers' schemas to standard messages, own ones field by field."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np

from tega.errors import RecordingError
from tega.recording.mcap_reader import Message
from tega_ros2.definitions import SCALARS, VIDEO, Definitions

_S: Final = 1_000_000_000
_LOG_LEVELS: Final = (0, 10, 20, 30, 40, 50)


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
        self._standard: dict[str, Callable[[Message], tuple[str, Any]]] = {
            "foxglove.RawImage": self._raw_image,
            "foxglove.CompressedImage": self._compressed_image,
            "foxglove.CompressedVideo": self._video,
            "foxglove.JointStates": self._joints,
            "foxglove.PoseInFrame": self._pose,
            "foxglove.FrameTransform": self._axes,
            "foxglove.Log": self._log,
        }

    def convert(self, message: Message) -> list[Converted]:
        """Return the ROS 2 messages of a message: itself, then those that standard tools show beside it."""
        standard = self._standard.get(message.schema)
        if standard is not None:
            return [Converted(message.topic, *standard(message))]
        if not message.schema.startswith("tega.") or message.value is None:
            raise RecordingError(
                f"{self._source}: {message.topic}: {message.schema!r} has no form in ROS 2",
                "export it as csv",
            )
        kind = self.definitions.own(message.value.DESCRIPTOR)
        header = self._header(self._own_ns(message), _finger(message.topic))
        own = Converted(message.topic, kind, self._own(message.value, kind, header=header))
        return [own, *self._beside(message, header)]

    def _own_ns(self, message: Message) -> int:
        # A hand's exchanges are stamped by the machine's monotonic clock.
        if message.schema == "tega.HandExchange" or not hasattr(message.value, "t_ns"):
            return message.log_ns
        return self.epoch_ns + int(message.value.t_ns)

    def _beside(self, message: Message, header: Any) -> list[Converted]:
        """Return the standard messages of the numbers that plots and other programs use."""
        value, topic = message.value, message.topic
        match message.schema:
            case "tega.Contact" if value.HasField("force_n"):
                # The axis z of the frame points into the finger, so that a press is positive.
                force = self._new("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=value.force_n)
                none = self._new("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
                wrench = self._new("geometry_msgs/msg/Wrench", force=force, torque=none)
                pad = self._new("std_msgs/msg/Header", stamp=header.stamp, frame_id=f"{_finger(topic)}_pad")
                kind = "geometry_msgs/msg/WrenchStamped"
                place = topic.removesuffix("contact") + "wrench"
                return [Converted(place, kind, self._new(kind, header=pad, wrench=wrench))]
            case "tega.Levels" if topic == "/emg/levels" and value.HasField("closure"):
                kind = "std_msgs/msg/Float64"
                return [Converted("/emg/closure", kind, self._new(kind, data=value.closure))]
            case "tega.EmgSamples" if value.n_channels > 0:
                kind = "std_msgs/msg/Float64MultiArray"
                return [Converted(f"{topic}/array", kind, self._samples(kind, value))]
            case "tega.State":
                kind = "std_msgs/msg/String"
                return [Converted(f"{topic}/text", kind, self._new(kind, data=value.state))]
            case _:
                return []

    def _samples(self, kind: str, value: Any) -> Any:
        n = len(value.samples) // value.n_channels
        sizes = (("sample", n, n * value.n_channels), ("channel", value.n_channels, value.n_channels))
        dims = [
            self._new("std_msgs/msg/MultiArrayDimension", label=label, size=size, stride=stride)
            for label, size, stride in sizes
        ]
        layout = self._new("std_msgs/msg/MultiArrayLayout", dim=dims, data_offset=0)
        return self._new(
            kind, layout=layout, data=np.array(value.samples[: n * value.n_channels], np.float64)
        )

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
        return self._new(kind, **header, **fields)

    # Standard messages.

    def _new(self, kind: str, /, **fields: Any) -> Any:
        return self._types[kind](**fields)

    def _time(self, t_ns: int) -> Any:
        seconds, rest_ns = divmod(t_ns, _S)
        if not 0 <= seconds < 2**31:
            raise RecordingError(
                f"{self._source}: a time of {seconds} s since 1970; ROS 2 has 0 to {2**31 - 1} s",
                "inspect the recording: one of its times is wrong",
            )
        return self._new("builtin_interfaces/msg/Time", sec=seconds, nanosec=rest_ns)

    def _header(self, t_ns: int, frame: str) -> Any:
        return self._new("std_msgs/msg/Header", stamp=self._time(t_ns), frame_id=frame)

    def _stamped(self, value: Any, frame: str) -> Any:
        return self._header(value.timestamp.seconds * _S + value.timestamp.nanos, frame)

    def _raw_image(self, message: Message) -> tuple[str, Any]:
        value, kind = message.value, "sensor_msgs/msg/Image"
        made = self._new(
            kind,
            header=self._stamped(value, value.frame_id),
            height=value.height,
            width=value.width,
            encoding=value.encoding,
            is_bigendian=0,
            step=value.step,
            data=np.frombuffer(value.data, np.uint8),
        )
        return kind, made

    def _compressed_image(self, message: Message) -> tuple[str, Any]:
        value, kind = message.value, "sensor_msgs/msg/CompressedImage"
        header, data = self._stamped(value, value.frame_id), np.frombuffer(value.data, np.uint8)
        return kind, self._new(kind, header=header, format=value.format, data=data)

    def _video(self, message: Message) -> tuple[str, Any]:
        value = message.value
        stamp = self._time(value.timestamp.seconds * _S + value.timestamp.nanos)
        data = np.frombuffer(value.data, np.uint8)
        made = self._new(VIDEO, timestamp=stamp, frame_id=value.frame_id, data=data, format=value.format)
        return VIDEO, made

    def _joints(self, message: Message) -> tuple[str, Any]:
        value, kind, none = message.value, "sensor_msgs/msg/JointState", np.empty(0)
        made = self._new(
            kind,
            header=self._stamped(value, ""),
            name=[joint.name for joint in value.joints],
            position=np.array([joint.position for joint in value.joints], np.float64),
            velocity=none,
            effort=none,
        )
        return kind, made

    def _pose(self, message: Message) -> tuple[str, Any]:
        value, kind = message.value, "geometry_msgs/msg/PoseStamped"
        place, turn = value.pose.position, value.pose.orientation
        pose = self._new(
            "geometry_msgs/msg/Pose",
            position=self._new("geometry_msgs/msg/Point", x=place.x, y=place.y, z=place.z),
            orientation=self._turn(turn),
        )
        return kind, self._new(kind, header=self._stamped(value, value.frame_id), pose=pose)

    def _turn(self, turn: Any) -> Any:
        return self._new("geometry_msgs/msg/Quaternion", x=turn.x, y=turn.y, z=turn.z, w=turn.w)

    def _axes(self, message: Message) -> tuple[str, Any]:
        value, kind = message.value, "geometry_msgs/msg/TransformStamped"
        place = value.translation
        transform = self._new(
            "geometry_msgs/msg/Transform",
            translation=self._new("geometry_msgs/msg/Vector3", x=place.x, y=place.y, z=place.z),
            rotation=self._turn(value.rotation),
        )
        header, child = self._stamped(value, value.parent_frame_id), value.child_frame_id
        return kind, self._new(kind, header=header, child_frame_id=child, transform=transform)

    def _log(self, message: Message) -> tuple[str, Any]:
        value, kind = message.value, "rcl_interfaces/msg/Log"
        made = self._new(
            kind,
            stamp=self._time(value.timestamp.seconds * _S + value.timestamp.nanos),
            level=_LOG_LEVELS[value.level] if 0 <= value.level < len(_LOG_LEVELS) else 0,
            name=value.name,
            msg=value.message,
            file=value.file,
            function="",
            line=value.line,
        )
        return kind, made


def _finger(topic: str) -> str:
    """Return the finger that a topic names, ``""`` for none."""
    return topic.split("/")[2] if topic.startswith("/tactile/") else ""
