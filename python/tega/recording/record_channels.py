"""Encode records into the channels of a Foxglove context, for a live stream or an MCAP file."""

from __future__ import annotations

import contextlib
import os
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from tega.errors import RecordingError
from tega.hand import JOINT_NAMES
from tega.recording.disk import RecordingDisk
from tega.recording.mcap_schemas import PACKAGE, encoded, message_class, record_messages, schema_bytes
from tega.recording.pictures import cell_sums
from tega.records import Joints, LogLine, Picture, PoseRecord, Record
from tega.records.base import VideoPacket
from tega.records.schema import own_schema, schema_name
from tega.runtime.files.whole_file import lock_file
from tega.runtime.lifecycle import require
from tega.runtime.threads import give_way

_CHUNK_BYTES = 4 * 1024 * 1024
# Of zstd: the noise of a camera hardly yields to more effort.
_LEVEL = 1
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
        if isinstance(record, Picture):
            self._picture(record, log_ns)
        elif own_schema(type(record)):
            self._message(record.where, record, log_ns)
        else:
            self._log(record.where, self._for_viewers(record), log_ns)

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

    def _log(self, topic: str, message: Any, log_ns: int) -> None:
        """Log a message of the SDK, whose channel is named as the message is."""
        make = getattr(self._channels_of, f"{type(message).__name__}Channel")
        self._channel(topic, make).log(message, log_time=log_ns)

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
        image, finger = record.image, record.finger
        height, width = image.shape[:2]
        stamp = self._stamp(record.t_ns)
        pixels, cells = image.tobytes(), b""
        if self._lossless:
            size = {"width": width, "height": height, "step": 3 * width}
            message = self._messages.RawImage(
                timestamp=stamp, frame_id=finger, encoding="bgr8", data=pixels, **size
            )
        else:
            whole = np.frombuffer(pixels, np.uint8).reshape(image.shape)
            with give_way():
                _, data = self._cv2.imencode(".jpg", whole, self._quality)
                cells = cell_sums(whole, self._cv2) if self._cells else b""
            message = self._messages.CompressedImage(
                timestamp=stamp, frame_id=finger, data=data.tobytes(), format="jpeg"
            )
        self._log(record.where, message, log_ns)
        summed = msgspec.structs.replace(record, pixels_crc32=zlib.crc32(pixels), cells=cells)
        self._message(_frame_topic(record), summed, log_ns)

    def _for_viewers(self, record: Any) -> Any:
        """Return the SDK's message of a record that has a schema of viewers."""
        sdk, stamp = self._messages, {"timestamp": self._stamp(record.t_ns)}
        match record:
            case VideoPacket():
                return sdk.CompressedVideo(
                    frame_id=record.camera, data=record.data, format=record.video, **stamp
                )
            case Joints():
                named = zip(JOINT_NAMES, record.angles_rad, strict=True)
                joints = [sdk.JointState(name=name, position=angle) for name, angle in named]
                return sdk.JointStates(joints=joints, **stamp)
            case LogLine():
                level = getattr(sdk.LogLevel, _LOG_LEVELS.get(record.level // 10 * 10, "Unknown"))
                return sdk.Log(level=level, message=record.text, name=record.name, **stamp)
            case PoseRecord():
                place = sdk.Vector3(**dict(zip("xyz", record.position, strict=True)))
                turn = sdk.Quaternion(**dict(zip("xyzw", record.quaternion, strict=True)))
                pose = sdk.Pose(position=place, orientation=turn)
                return sdk.PoseInFrame(frame_id=record.frame, pose=pose, **stamp)
            case _:  # how the axes of one frame lie in another
                turn = sdk.Quaternion(**dict(zip("xyzw", record.quaternion, strict=True)))
                axes = {"translation": sdk.Vector3(x=0.0, y=0.0, z=0.0), "rotation": turn}
                frames = {"parent_frame_id": record.parent, "child_frame_id": record.child}
                return sdk.FrameTransform(**frames, **axes, **stamp)


def _frame_topic(picture: Picture) -> str:
    return f"{picture.where.rpartition('/')[0]}/frame"


class McapFile(RecordChannels):
    """A file that grows by items; ``path`` must not exist. ``disk`` knows its size, and an error that ends it.

    Pictures are kept as they are (``lossless``), else as JPEG of ``jpeg_quality``, 1 to 100. At most
    ``most_bytes`` wait in memory for the disk.
    """

    def __init__(
        self,
        path: Path,
        *,
        lossless: bool,
        jpeg_quality: int = 95,
        most_bytes: int = 128 * 1024 * 1024,
    ) -> None:
        super().__init__(lossless=lossless, jpeg_quality=jpeg_quality, cells=True)
        options = require("foxglove.mcap", driver="recording", extra="record")
        try:
            self._raw = path.open("xb", buffering=0)
        except OSError as error:
            raise RecordingError(
                f"{path.name}: cannot be made: {error.strerror}", f"looked at {path.parent}"
            ) from error
        lock_file(self._raw, path)
        self.disk = RecordingDisk(self._raw, path, most_bytes=most_bytes)
        # A thread of its own for compression would only wait for the one that writes.
        self._writer = self._foxglove.open_mcap(
            self.disk,
            context=self.context,
            writer_options=options.MCAPWriteOptions(
                chunk_size=_CHUNK_BYTES, compression_level=_LEVEL, compression_threads=0, disable_seeking=True
            ),
        )

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add a table of names and texts."""
        self._writer.write_metadata(name, dict(values))

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Add a file."""
        self._writer.attach(
            log_time=self.epoch_ns, create_time=self.epoch_ns, name=name, media_type=media_type, data=data
        )

    def flush(self) -> None:
        """Hand everything to where it outlives this process."""
        self._writer.flush()
        self.disk.flush()

    def sync(self) -> None:
        """Wait until all that was flushed is on the disk, which outlives the power; any thread may."""
        if self.disk.error is None:
            # A pipe cannot be waited for, nor a file that was closed meanwhile.
            with contextlib.suppress(OSError, ValueError):
                os.fsync(self._raw.fileno())

    def close(self) -> None:
        """Write the index and close the file."""
        try:
            self._writer.close()
        finally:
            try:
                self.disk.close()
            finally:
                with contextlib.suppress(OSError):
                    self._raw.close()
