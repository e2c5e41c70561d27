"""Read a recording from its beginning to its end, or to where it was cut."""

from __future__ import annotations

import io
import struct
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, NamedTuple

from tega.errors import RecordingError
from tega.recording.foreign import no_session
from tega.recording.mcap_schemas import decoder
from tega.runtime.files.foreign_file import MIB, check_file
from tega.runtime.lifecycle import require
from tega.runtime.opencv import load_cv2

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


Progress = Callable[[str, int, int], None]
"""Called with what is being done, how many units of it are done, and how many there are."""


def _no_progress(_subject: str, _done: int, _total: int) -> None:
    """Show nothing."""


# A day of four cameras without loss is less; a record of TEGA's is at most one chunk of 4 MiB and one picture.
_MOST_MIB = 1024 * 1024
MOST_RECORD = 256 * MIB
"""Bytes of a record; of a longer one the file counts as damaged."""


# Of a record its kind and length, and of a message what stands before its data: channel, number, two times.
_RECORD, _MESSAGE = struct.Struct("<BQ"), struct.Struct("<HIQQ")


class Message(NamedTuple):
    """A message of a recording.

    Attributes:
        topic: Its channel.
        schema: Name of its schema, such as ``tega.Contact``.
        log_ns: Time of arrival, nanoseconds since 1970.
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
        RecordingError: The path is missing, not a file, or the file is larger than a recording can be.
    """
    try:
        check_file(path, most_mib=_MOST_MIB)
        return path.open("rb")
    except OSError as error:
        raise RecordingError(f"{path.name}: cannot be read: {error.strerror}") from error


class McapReader:
    """Passes over a file. Needs no index, so that a cut file is read as far as it goes.

    Args:
        path: The file.
        data: Its content, where it is no file of its own; ``path`` is then only its name.
        check_sums: If true, treat a part with a wrong checksum as the end of the file, like other damage.

    Attributes:
        metadata: Tables of names and texts, as far as the pass has come.
        files: Attachments, as far as the pass has come.
        progress: Called with the file's name, the MiB that were read, and all MiB; replace it to display them.
        cut: Reason for an early end of the file; ``""`` before that, and in a complete one.
        part_begins: Place in the file of the part that holds the message which a pass has just returned.
    """

    def __init__(self, path: Path, *, data: bytes | None = None, check_sums: bool = False) -> None:
        self.path = path
        self._data = data
        self._check_sums = check_sums
        self._schemas: dict[int, Any] = {}
        self._channels: dict[int, Any] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        self.files: dict[str, bytes] = {}
        self.cut = ""
        self.part_begins = 0
        self._own = False
        self.progress: Progress = _no_progress

    @property
    def complete(self) -> bool:
        """Whether the file was finished, and not recovered or cut, as far as that is known yet."""
        return not self.cut and "end" in self.metadata

    def messages(self, wanted: Callable[[str], bool] = lambda _topic: True) -> Iterator[Message]:
        """Return the messages in the order in which they were written.

        Args:
            wanted: Asked per topic whether to decode.

        Raises:
            RecordingError: The file cannot be opened, is no MCAP, or was not recorded by TEGA.
            MissingExtraError: A package of the extra ``record`` is not installed.
        """
        reading = require("mcap.stream_reader", driver="replay", extra="record")
        records = require("mcap.records", driver="replay", extra="record")
        faults = require("mcap.exceptions", driver="replay", extra="record")
        if self._data is None and self.path.is_file() and not self.path.stat().st_size:
            raise no_session(self.path, ())
        with open_recording(self.path) if self._data is None else io.BytesIO(self._data) as file:
            source = iter(
                reading.StreamReader(
                    file,
                    emit_chunks=True,
                    validate_crcs=self._check_sums,
                    record_size_limit=MOST_RECORD,
                ).records
            )
            mib = file.seek(0, io.SEEK_END) // MIB
            file.seek(0)
            while True:
                begins = file.tell()
                self.progress(self.path.name, begins // MIB, mib)
                try:
                    record = next(source, None)
                    inside = [record]
                    if isinstance(record, records.Chunk):
                        inside = chunk_records(record, check_sum=self._check_sums)
                except faults.InvalidMagic:
                    if not self._channels and not self.metadata:
                        raise RecordingError(
                            f"{self.path.name}: no MCAP file", "name a recording made with --record"
                        ) from None
                    self.cut = "InvalidMagic"
                    return
                except Exception as error:  # whatever damage makes the reader say: all before it is good
                    self.cut = type(error).__name__
                    return
                if record is None:
                    self._check_own()
                    return
                self.part_begins = begins
                for one in inside:
                    if not isinstance(one, records.Message):
                        self._keep(one, records)
                        continue
                    self._check_own()
                    try:
                        message = decoded_message(one, self._channels[one.channel_id], self._schemas, wanted)
                    except Exception as error:  # of a damaged schema or message, or one of an unknown channel
                        self.cut = type(error).__name__
                        return
                    yield message

    def _keep(self, record: Any, records: Any) -> None:
        if isinstance(record, records.Schema):
            self._schemas[record.id] = record
        elif isinstance(record, records.Channel):
            self._channels[record.id] = record
        elif isinstance(record, records.Metadata):
            self.metadata.setdefault(record.name, {}).update(record.metadata)
        elif isinstance(record, records.Attachment):
            self.files[record.name] = record.data
        elif isinstance(record, records.Header):
            self._own = record.library == "tega"  # one that was recovered or copied, whatever is left of it

    def _check_own(self) -> None:
        """Refuse a file that another program wrote; a part of a recording is not asked."""
        if self._own or self._data is not None:
            return
        names = [*self.metadata, *(schema.name for schema in self._schemas.values())]
        if not any(name.startswith("tega") for name in names):
            raise no_session(self.path, names)
        self._own = True


def chunk_records(chunk: Any, *, check_sum: bool = False) -> list[Any]:
    """Return the records of a part of the file, as the package ``mcap`` does in seven times the time.

    Raises:
        Exception: Of many types where the part is damaged.
    """
    reading = require("mcap.stream_reader", driver="replay", extra="record")
    records = require("mcap.records", driver="replay", extra="record")
    stream, n_bytes = reading.get_chunk_data_stream(chunk, validate_crc=check_sum)
    data: bytes = stream.read(n_bytes)
    made, at = list[Any](), 0
    while at < n_bytes:
        kind, length = _RECORD.unpack_from(data, at)
        begins, at = at + _RECORD.size, at + _RECORD.size + length
        if at > n_bytes:
            raise EOFError("a record ends behind its part of the file")
        if kind == reading.Opcode.MESSAGE:
            channel, number, log_ns, published_ns = _MESSAGE.unpack_from(data, begins)
            content = data[begins + _MESSAGE.size : at]
            made.append(records.Message(channel, log_ns, content, published_ns, number))
        elif kind in {reading.Opcode.CHANNEL, reading.Opcode.SCHEMA}:
            read = records.Channel.read if kind == reading.Opcode.CHANNEL else records.Schema.read
            made.append(read(reading.ReadDataStream(io.BytesIO(data[begins:at]))))
    return made


def decoded_message(
    record: Any, channel: Any, schemas: dict[int, Any], wanted: Callable[[str], bool]
) -> Message:
    """Return a message of the file, its value decoded where its topic is wanted."""
    schema, value = schemas.get(channel.schema_id), None
    if schema is not None and schema.encoding == "protobuf" and wanted(channel.topic):
        value = decoder(schema.name, schema.data).FromString(record.data)
    name = "" if schema is None else schema.name
    return Message(channel.topic, name, record.log_time, len(record.data), value)


def table_ns(table: Mapping[str, str], name: str) -> int | None:
    """Return a number of nanoseconds from a table of a file; ``None`` if it is not such a number."""
    text = table.get(name, "")
    return int(text) if text.isascii() and text.isdecimal() and len(text) < 20 else None


def read_picture(message: Message) -> NDArray[np.uint8]:
    """Return the image of an image message, uint8 (H, W, 3) in BGR; approximate if it was JPEG."""
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
