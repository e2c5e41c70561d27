"""Read a recording from its beginning to its end, or to where it was cut."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, NamedTuple

from tega.errors import RecordingError
from tega.foreign_file import MIB, check_file
from tega.lifecycle import require
from tega.opencv import load_cv2
from tega.recording.mcap_schemas import decoder

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


# A day of four cameras without loss is less; a record of TEGA's is at most one chunk of 4 MiB and one picture.
_MOST_MIB = 1024 * 1024
MOST_RECORD = 256 * MIB
"""Bytes of a record; of a longer one the file counts as damaged."""


class Message(NamedTuple):
    """A message of a recording.

    Attributes:
        topic: Its channel.
        schema: Name of its schema, such as ``tega.Contact``.
        log_ns: When it came, nanoseconds since 1970.
        n_bytes: Its size in the file before compression.
        value: Decoded; ``None`` where the caller did not want it.
    """

    topic: str
    schema: str
    log_ns: int
    n_bytes: int
    value: Any


def open_recording(path: Path) -> IO[bytes]:
    """Open a recording's file, finished or not.

    Raises:
        RecordingError: It is missing, no file, or larger than a recording can be.
    """
    try:
        check_file(path, most_mib=_MOST_MIB)
        return path.open("rb")
    except OSError as error:
        raise RecordingError(f"{path.name}: cannot be read: {error.strerror}") from error


class McapReader:
    """One pass over a file. Needs no index, so that a cut file is read as far as it goes.

    Args:
        path: The file.
        data: Its content, where it is no file of its own; ``path`` is then only its name.
        check_sums: Take a part whose checksum is wrong for the file's end, like other damage.

    Attributes:
        metadata: Tables of names and texts, as far as the pass has come.
        files: Attachments, likewise.
        cut: Why the file ends early; ``""`` while it has not, and in one that is complete.
    """

    def __init__(self, path: Path, *, data: bytes | None = None, check_sums: bool = False) -> None:
        self.path = path
        self._data = data
        self._check_sums = check_sums
        self.metadata: dict[str, dict[str, str]] = {}
        self.files: dict[str, bytes] = {}
        self.cut = ""

    def messages(self, wanted: Callable[[str], bool] = lambda _topic: True) -> Iterator[Message]:
        """Return the messages in the order in which they were written.

        Args:
            wanted: Asked per topic whether to decode.

        Raises:
            RecordingError: The file cannot be opened, or is no MCAP.
            MissingExtraError: A package of the extra ``record`` is not installed.
        """
        reading = require("mcap.stream_reader", driver="replay", extra="record")
        records = require("mcap.records", driver="replay", extra="record")
        faults = require("mcap.exceptions", driver="replay", extra="record")
        schemas: dict[int, Any] = {}
        channels: dict[int, Any] = {}
        with open_recording(self.path) if self._data is None else io.BytesIO(self._data) as file:
            source = iter(
                reading.StreamReader(
                    file, validate_crcs=self._check_sums, record_size_limit=MOST_RECORD
                ).records
            )
            while True:
                try:
                    record = next(source, None)
                except faults.InvalidMagic:
                    if not channels and not self.metadata:
                        raise RecordingError(
                            f"{self.path.name}: no MCAP file", "name a recording made with --record"
                        ) from None
                    self.cut = "InvalidMagic"
                    return
                except Exception as error:  # whatever damage makes the reader say: all before it is good
                    self.cut = type(error).__name__
                    return
                if record is None:
                    return
                if isinstance(record, records.Message):
                    try:
                        message = _message(record, channels[record.channel_id], schemas, wanted)
                    except Exception as error:  # of a damaged schema or message, or one of an unknown channel
                        self.cut = type(error).__name__
                        return
                    yield message
                elif isinstance(record, records.Schema):
                    schemas[record.id] = record
                elif isinstance(record, records.Channel):
                    channels[record.id] = record
                else:
                    self._keep(record, records)

    def _keep(self, record: Any, records: Any) -> None:
        if isinstance(record, records.Metadata):
            self.metadata.setdefault(record.name, {}).update(record.metadata)
        elif isinstance(record, records.Attachment):
            self.files[record.name] = record.data


def _message(record: Any, channel: Any, schemas: dict[int, Any], wanted: Callable[[str], bool]) -> Message:
    schema, value = schemas.get(channel.schema_id), None
    if schema is not None and schema.encoding == "protobuf" and wanted(channel.topic):
        value = decoder(schema.name, schema.data).FromString(record.data)
    name = "" if schema is None else schema.name
    return Message(channel.topic, name, record.log_time, len(record.data), value)


def read_picture(message: Message) -> NDArray[np.uint8]:
    """Return the picture of an image message, uint8 (H, W, 3) in BGR; what was JPEG is approximate."""
    import numpy as np

    value = message.value
    data = np.frombuffer(value.data, np.uint8)
    if message.schema == "foxglove.RawImage":
        if len(data) != value.height * value.width * 3:
            raise RecordingError(
                f"{message.topic}: a picture of {len(data)} bytes, not {value.height}×{value.width}×3",
                "the recording is damaged there; trim it before",
            )
        return data.reshape(value.height, value.width, 3)
    cv2 = load_cv2("recording")
    decoded: NDArray[np.uint8] | None = cv2.imdecode(data, cv2.IMREAD_COLOR) if len(data) else None
    if decoded is None:
        raise RecordingError(
            f"{message.topic}: a picture of {len(data)} bytes cannot be decoded",
            "the recording is damaged there; trim it before",
        )
    return decoded
