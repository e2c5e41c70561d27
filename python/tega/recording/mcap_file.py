"""Write one MCAP file through foxglove-sdk, by one thread."""

from __future__ import annotations

import contextlib
import os
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import msgspec
import numpy as np

from tega.errors import RecordingError
from tega.file_lock import lock_file
from tega.hand import JOINT_NAMES
from tega.lifecycle import require
from tega.recording.disk import open_disk
from tega.recording.mcap_schemas import MESSAGES, PACKAGE, encoded, message_class, schema_bytes
from tega.records import Joints, LogLine, Picture, PoseRecord, TrackerAxes
from tega.records.schema import schema_name

if TYPE_CHECKING:
    from tega.records import Record

__all__ = ["McapFile"]

_CHUNK_BYTES = 4 * 1024 * 1024
# Of zstd: the noise of a camera hardly yields to more effort.
_LEVEL = 1
_LOG_LEVELS = {10: "Debug", 20: "Info", 30: "Warning", 40: "Error", 50: "Fatal"}


class McapFile:
    """A file that grows by items.

    Args:
        path: The file; it must not exist.
        lossless: Pictures as they are; else as JPEG.
        jpeg_quality: 1 to 100.
        most_bytes: What may wait in memory for the disk.
        raw: Something else to write to, opened for writing without a buffer; the file at ``path`` when ``None``.

    Attributes:
        epoch_ns: Time of day at the start of the session, ns: what viewers show is this plus the session's time.

    Raises:
        MissingExtraError: A package of the extra ``record`` is not installed.
        RecordingError: The file cannot be made.
    """

    def __init__(
        self,
        path: Path,
        *,
        lossless: bool,
        jpeg_quality: int = 95,
        most_bytes: int = 128 * 1024 * 1024,
        raw: BinaryIO | None = None,
    ) -> None:
        foxglove = require("foxglove", driver="recording", extra="record")
        self._channels_of = require("foxglove.channels", driver="recording", extra="record")
        self._messages = require("foxglove.messages", driver="recording", extra="record")
        options = require("foxglove.mcap", driver="recording", extra="record")
        for kind in MESSAGES:  # now, so that no class is built while the loop runs
            message_class(kind)
        self._cv2: Any = None
        if not lossless:
            self._cv2 = require("cv2", driver="recording", extra="record")
            self._quality = [self._cv2.IMWRITE_JPEG_QUALITY, jpeg_quality]
        self._foxglove = foxglove
        self.epoch_ns = 0
        self._lossless = lossless
        try:
            self._raw = path.open("xb", buffering=0) if raw is None else raw
        except OSError as error:
            raise RecordingError(
                f"{path.name}: cannot be made: {error.strerror}", f"looked at {path.parent}"
            ) from error
        lock_file(self._raw, path)
        self._disk = open_disk(self._raw, path, most_bytes=most_bytes)
        self._context = foxglove.Context()
        # A thread of its own for compression would only wait for the one that writes.
        self._writer = foxglove.open_mcap(
            self._disk,
            context=self._context,
            writer_options=options.MCAPWriteOptions(
                chunk_size=_CHUNK_BYTES,
                compression_level=_LEVEL,
                compression_threads=0,
                disable_seeking=True,
            ),
        )
        self._channels: dict[str, Any] = {}
        self.n_items = 0

    @property
    def n_bytes(self) -> int:
        """Bytes written so far."""
        return self._disk.n_bytes

    @property
    def error(self) -> OSError | None:
        """Why the file cannot be written any more."""
        return self._disk.error

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add a table of names and texts."""
        self._writer.write_metadata(name, dict(values))

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Add a file."""
        self._writer.attach(
            log_time=self.epoch_ns,
            create_time=self.epoch_ns,
            name=name,
            media_type=media_type,
            data=data,
        )

    def write(self, record: Record, t_ns: int) -> None:
        """Encode a record and add it.

        Args:
            record: What is to be written.
            t_ns: When it came, nanoseconds since the start of the session.
        """
        log_ns = self.epoch_ns + t_ns
        self.n_items += 1
        match record:
            case Picture():
                self._picture(record, log_ns)
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

    def flush(self) -> None:
        """Hand everything to where it outlives this process."""
        self._writer.flush()
        self._disk.flush()

    def sync(self) -> None:
        """Wait until all that was flushed is on the disk, which outlives the power; any thread may."""
        if self._disk.error is None:
            # A pipe cannot be waited for, nor a file that was closed meanwhile.
            with contextlib.suppress(OSError, ValueError):
                os.fsync(self._raw.fileno())

    def close(self) -> None:
        """Write the index and close the file."""
        try:
            self._writer.close()
            self._disk.close()
        finally:
            with contextlib.suppress(OSError):
                self._raw.close()

    def _channel(self, topic: str, make: Any, **how: Any) -> Any:
        channel = self._channels.get(topic)
        if channel is None:
            channel = self._channels[topic] = make(topic, context=self._context, **how)
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
        pixels = image.tobytes()
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
            _, data = self._cv2.imencode(".jpg", whole, self._quality)
            message = self._messages.CompressedImage(
                timestamp=stamp, frame_id=record.finger, data=data.tobytes(), format="jpeg"
            )
        channel.log(message, log_time=log_ns)
        summed = msgspec.structs.replace(record, pixels_crc32=zlib.crc32(pixels))
        self._message(f"{topic.rpartition('/')[0]}/frame", summed, log_ns)

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
