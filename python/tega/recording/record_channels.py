"""Encode records into the channels of a Foxglove context, for a file or a live stream."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np

from tega.hand import JOINT_NAMES
from tega.recording.mcap_schemas import PACKAGE, encoded, message_class, record_messages, schema_bytes
from tega.recording.pictures import cell_sums
from tega.records import Joints, LogLine, Picture, PoseRecord, Record, TrackerAxes
from tega.records.base import VideoPacket
from tega.records.schema import schema_name
from tega.runtime.lifecycle import require
from tega.runtime.threads import give_way

_LOG_LEVELS = {10: "Debug", 20: "Info", 30: "Warning", 40: "Error", 50: "Fatal"}


class RecordChannels:
    """Channels of a context of its own, one a topic, made as records come.

    ``lossless`` keeps pictures as they are, else they are JPEG of ``jpeg_quality``, 1 to 100, with ``cells``
    beside which the sums that the metric ``live`` reads are kept. ``open_channel`` makes the channel of a
    topic, given the SDK's class of channels and its arguments; by default a channel of the context. It has
    ``has_sinks()`` and ``log(message, log_time=)``.

    ``epoch_ns`` is the time of day at the start of the session, ns; viewers show this plus the session's
    time. ``context`` is the SDK's.
    """

    def __init__(
        self,
        *,
        lossless: bool,
        jpeg_quality: int = 95,
        cells: bool = False,
        open_channel: Callable[..., Any] | None = None,
    ) -> None:
        self._foxglove = require("foxglove", driver="recording", extra="record")
        self._channels_of = require("foxglove.channels", driver="recording", extra="record")
        self._messages = require("foxglove.messages", driver="recording", extra="record")
        for kind in record_messages():  # now, so that no class is built while the loop runs
            message_class(kind)
        self._cv2: Any = None
        if not lossless:
            self._cv2 = require("cv2", driver="recording", extra="record")
            self._quality = [self._cv2.IMWRITE_JPEG_QUALITY, jpeg_quality]
        self._lossless, self._cells = lossless, cells
        self._channels: dict[str, Any] = {}
        self.epoch_ns = 0
        self.context: Any = self._foxglove.Context()
        self._open: Callable[..., Any] = open_channel or (
            lambda topic, make, **how: make(topic, context=self.context, **how)
        )

    def write(self, record: Record, t_ns: int) -> None:
        """Encode and log a record, unless its channel has no subscriber; make a new channel for later ones.

        ``t_ns`` is its arrival, nanoseconds since the start of the session.
        """
        if not self._received(record):
            return
        log_ns = self.epoch_ns + t_ns
        match record:
            case Picture():
                self._picture(record, log_ns)
            case VideoPacket():
                self._video(record, log_ns)
            case Joints():
                self._joints(record, log_ns)
            case LogLine():
                self._log(record, log_ns)
            case PoseRecord():
                self._pose(record, log_ns)
            case TrackerAxes():
                self._axes(record, log_ns)
            case _:
                self._message(record.where, record, log_ns)

    def _received(self, record: Record) -> bool:
        topics = [record.where]
        if isinstance(record, Picture):
            topics.append(_frame_topic(record))
        channels = [self._channels.get(topic) for topic in topics]
        return any(channel is None or channel.has_sinks() for channel in channels)

    def _channel(self, topic: str, make: Any, **how: Any) -> Any:
        channel = self._channels.get(topic)
        if channel is None:
            channel = self._channels[topic] = self._open(topic, make, **how)
        return channel

    def _message(self, topic: str, record: Record, log_ns: int) -> None:
        schema = None
        if topic not in self._channels:
            name = f"{PACKAGE}.{schema_name(type(record))}"
            schema = self._foxglove.Schema(name=name, encoding="protobuf", data=schema_bytes())
        channel = self._channel(topic, self._foxglove.Channel, message_encoding="protobuf", schema=schema)
        channel.log(encoded(record), log_time=log_ns)

    def _stamp(self, t_ns: int) -> Any:
        return self._messages.Timestamp(*divmod(self.epoch_ns + t_ns, 1_000_000_000))

    def _picture(self, record: Picture, log_ns: int) -> None:
        """Write a picture, then its number and exact times beside it."""
        image, topic = record.image, record.where
        height, width = image.shape[:2]
        stamp = self._stamp(record.t_ns)
        pixels, cells = image.tobytes(), b""
        if self._lossless:
            channel = self._channel(topic, self._channels_of.RawImageChannel)
            message = self._messages.RawImage(
                timestamp=stamp,
                frame_id=record.finger,
                width=width,
                height=height,
                encoding="bgr8",
                step=3 * width,
                data=pixels,
            )
        else:
            channel = self._channel(topic, self._channels_of.CompressedImageChannel)
            whole = np.frombuffer(pixels, np.uint8).reshape(image.shape)
            with give_way():
                _, data = self._cv2.imencode(".jpg", whole, self._quality)
                cells = cell_sums(whole, self._cv2) if self._cells else b""
            message = self._messages.CompressedImage(
                timestamp=stamp, frame_id=record.finger, data=data.tobytes(), format="jpeg"
            )
        channel.log(message, log_time=log_ns)
        summed = msgspec.structs.replace(record, pixels_crc32=zlib.crc32(pixels), cells=cells)
        self._message(_frame_topic(record), summed, log_ns)

    def _video(self, record: VideoPacket, log_ns: int) -> None:
        message = self._messages.CompressedVideo(
            timestamp=self._stamp(record.t_ns), frame_id=record.camera, data=record.data, format=record.video
        )
        self._channel(record.where, self._channels_of.CompressedVideoChannel).log(message, log_time=log_ns)

    def _joints(self, record: Joints, log_ns: int) -> None:
        make = self._messages.JointState
        states = [make(name=name, position=a) for name, a in zip(JOINT_NAMES, record.angles_rad, strict=True)]
        channel = self._channel(record.where, self._channels_of.JointStatesChannel)
        channel.log(
            self._messages.JointStates(timestamp=self._stamp(record.t_ns), joints=states), log_time=log_ns
        )

    def _log(self, record: LogLine, log_ns: int) -> None:
        channel = self._channel(record.where, self._channels_of.LogChannel)
        level = getattr(self._messages.LogLevel, _LOG_LEVELS.get(record.level // 10 * 10, "Unknown"))
        message = self._messages.Log(
            timestamp=self._stamp(record.t_ns), level=level, message=record.text, name=record.name
        )
        channel.log(message, log_time=log_ns)

    def _pose(self, record: PoseRecord, log_ns: int) -> None:
        message = self._messages.PoseInFrame(
            timestamp=self._stamp(record.t_ns),
            frame_id=record.frame,
            pose=self._messages.Pose(
                position=self._messages.Vector3(**dict(zip("xyz", record.position, strict=True))),
                orientation=self._messages.Quaternion(**dict(zip("xyzw", record.quaternion, strict=True))),
            ),
        )
        self._channel(record.where, self._channels_of.PoseInFrameChannel).log(message, log_time=log_ns)

    def _axes(self, record: TrackerAxes, log_ns: int) -> None:
        """Write how the axes of one frame lie in another."""
        message = self._messages.FrameTransform(
            timestamp=self._stamp(record.t_ns),
            parent_frame_id=record.parent,
            child_frame_id=record.child,
            translation=self._messages.Vector3(x=0.0, y=0.0, z=0.0),
            rotation=self._messages.Quaternion(**dict(zip("xyzw", record.quaternion, strict=True))),
        )
        self._channel(record.where, self._channels_of.FrameTransformChannel).log(message, log_time=log_ns)


def _frame_topic(picture: Picture) -> str:
    """Return the topic of a picture's number and exact times."""
    return f"{picture.where.rpartition('/')[0]}/frame"
