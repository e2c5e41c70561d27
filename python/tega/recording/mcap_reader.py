"""Read a recording from its beginning to its end, or to where it was cut."""

from __future__ import annotations

import io
import logging
import math
import struct
from collections.abc import Callable, Container, Generator, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from functools import cache
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Final, NamedTuple, TypeVar

from tega.errors import RecordingError
from tega.recording.mcap_schemas import decoder
from tega.recording.origin import no_session
from tega.runtime.files.foreign_file import MIB, check_file
from tega.runtime.lifecycle import require
from tega.runtime.opencv import load_cv2

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


_LOG = logging.getLogger(__name__)

Item = TypeVar("Item")
Progress = Callable[[str, int, int], None]
"""Called with what is being done, how many units of it are done, and how many there are."""


Within = tuple[int, float]
"""Where in a file the first part to read begins, and the first that is not read."""
WHOLE: Final[Within] = (0, math.inf)

# A day of four cameras without loss is less; a record of TEGA's is at most one chunk of 4 MiB and one picture.
_MOST_MIB = 1024 * 1024
MOST_RECORD = 256 * MIB
"""Bytes of a record; of a longer one the file counts as damaged."""


# Of a record its kind and length, and of a message what stands before its data: channel, number, two times.
_RECORD, _MESSAGE = struct.Struct("<BQ"), struct.Struct("<HIQQ")


class Message(NamedTuple):
    """A message of a recording.

    Attributes:
        schema: Name of its schema, such as ``tega.Contact``.
        log_ns: Time of arrival, nanoseconds since 1970.
        n_bytes: Its size in the file before compression.
        value: Decoded; ``None`` where the caller did not want it.
        image: With a picture's numbers and times, its image; put there by
            :func:`tega.recording.pictures.paired`.
    """

    topic: str
    schema: str
    log_ns: int
    n_bytes: int
    value: Any
    image: Message | None = None


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


class RawMessage(NamedTuple):
    """A message as it stands in the file."""

    channel_id: int
    log_ns: int
    data: bytes | memoryview


class Plan(NamedTuple):
    """How the messages of a channel are read: its topic, its schema's name, and what decodes them, if anything."""

    topic: str
    schema: str
    decode: Callable[[bytes | memoryview], Any] | None

    def message(self, raw: RawMessage) -> Message:
        """Return a message, decoded where it is to be."""
        topic, schema, decode = self
        _, log_ns, data = raw
        return Message(topic, schema, log_ns, len(data), None if decode is None else decode(data))


class McapReader:
    """Passes over a file. Needs no index, so that a cut file is read as far as it goes.

    If ``data`` is its content, ``path`` is only its name. A part with a wrong checksum is the end of the file,
    like other damage.

    Attributes:
        metadata: Tables of names and texts, as far as the pass has come.
        files: Attachments, as far as the pass has come.
        progress: Called with the file's name, the MiB that were read, and all MiB; replace it for a display.
        cut: Reason for an early end of the file; ``""`` before that, and in a complete one.
        part_begins: Place in the file of the part that holds the message which a pass has just returned.
    """

    def __init__(self, path: Path, *, data: bytes | None = None) -> None:
        self.path = path
        self._data = data
        self._schemas: dict[int, Any] = {}
        self._channels: dict[int, Any] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        self.files: dict[str, bytes] = {}
        self.cut = ""
        self.part_begins = 0
        self._own = False
        self.progress: Progress = lambda _subject, _done, _total: None

    @property
    def complete(self) -> bool:
        """Whether the file was finished, and not stopped, recovered or cut, as far as that is known yet."""
        return not self.cut and self.metadata.get("end", {}).get("state") == "complete"

    def warn_cut(self) -> None:
        """Warn where the file could not be read to its end; an export has what comes before."""
        if self.cut:
            said = "%s: cannot be read to its end: %s; what comes before is exported, inspect says how far"
            _LOG.warning(said, self.path.name, self.cut)

    def begin(self) -> Message | None:
        """Read up to the first message, before which are the head's tables and attachments, and return that."""
        return next(self.messages(lambda _topic: False), None)

    def session_tables(self) -> Mapping[str, Mapping[str, str]]:
        """Return the tables of the head; ``RecordingError`` if they are not those of a session that had begun."""
        self.begin()
        if "epoch_ns" not in self.metadata.get("tega", {}):
            raise no_session(self.path, self.metadata)
        return self.metadata

    def messages(
        self,
        wanted: Callable[[str], bool] = lambda _topic: True,
        within: Within = WHOLE,
        *,
        every: bool = True,
    ) -> Generator[Message]:
        """Return the messages in the order of writing; ``wanted`` is asked per topic whether to decode.

        Without ``every`` those that are not decoded are left out. Of a part of the file that is not its
        beginning only a reader with an index knows the channels.

        Raises ``RecordingError`` also for an MCAP that was not recorded by TEGA.
        """
        faults = require("mcap.exceptions", driver="replay", extra="record")
        if self._data is None and self.path.is_file() and not self.path.stat().st_size:
            raise no_session(self.path, ())
        plans: dict[int, Plan] = {}
        passed = set[int]()
        with (
            open_recording(self.path) if self._data is None else io.BytesIO(self._data) as file,
            closing(read_ahead(self._parts(file, within[1], passed))) as parts,
        ):
            mib = int(min(file.seek(0, io.SEEK_END), within[1])) // MIB
            file.seek(within[0])
            while True:
                try:
                    part = next(parts, None)
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
                if part is None:
                    self._check_own()
                    self.progress(self.path.name, mib, mib)
                    return
                self.part_begins, inside = part
                self.progress(self.path.name, self.part_begins // MIB, mib)
                for one in inside:
                    if type(one) is not RawMessage:
                        self._keep(one)
                        continue
                    if not self._own:
                        self._check_own()
                    try:
                        plan = plans.get(one.channel_id)
                        if plan is None:
                            channel = self._channels[one.channel_id]
                            plan = plans[one.channel_id] = self.plan_of(channel, decode=wanted(channel.topic))
                        if plan.decode is None and not every:
                            passed.add(one.channel_id)
                            continue
                        message = plan.message(one)
                    except Exception as error:  # of a damaged schema or message, or one of an unknown channel
                        self.cut = type(error).__name__
                        return
                    yield message

    def plan_of(self, channel: Any, *, decode: bool) -> Plan:
        """Return how the messages of a channel are read."""
        schema = self._schemas.get(channel.schema_id)
        if schema is None:
            return Plan(channel.topic, "", None)
        decode = decode and schema.encoding == "protobuf"
        return Plan(
            channel.topic, schema.name, decoder(schema.name, schema.data).FromString if decode else None
        )

    def _parts(self, file: IO[bytes], ends: float, passed: Container[int]) -> Iterator[tuple[int, list[Any]]]:
        """Read the file's parts from where it stands: where each begins, and the records in it."""
        begins = file.tell()
        reader = _pass_reader()(
            file, skip_magic=begins > 0, emit_chunks=True, validate_crcs=True, record_size_limit=MOST_RECORD
        )
        for record in reader.records:
            if begins >= ends:
                return
            if type(record).__name__ != "MessageIndex":
                yield begins, chunk_records(record, passed=passed)
            begins = file.tell()

    def _keep(self, record: Any) -> None:
        records = require("mcap.records", driver="replay", extra="record")
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


@cache
def _pass_reader() -> Any:
    """Return the public reader, which here passes over the lists of messages that follow each part."""
    reading: Any = require("mcap.stream_reader", driver="replay", extra="record")

    class PassReader(reading.StreamReader):  # type: ignore[misc]  # the package may be missing
        def _read_record(self, opcode: int, length: int) -> Any:
            passed = opcode == reading.Opcode.MESSAGE_INDEX
            return reading.MessageIndex(0, []) if passed else super()._read_record(opcode, length)

    return PassReader


def read_ahead(items: Iterator[Item]) -> Generator[Item]:
    """Return the items, each made by another thread while the one before it is used: unpacking needs no interpreter."""
    nothing: Any = object()
    with ThreadPoolExecutor(1, "tega-read") as pool:
        following = pool.submit(next, items, nothing)
        while (item := following.result()) is not nothing:
            following = pool.submit(next, items, nothing)
            yield item


def chunk_records(record: Any, *, passed: Container[int] = ()) -> list[Any]:
    """Return the records of a part of the file, as the package ``mcap`` does in ten times the time.

    They are messages as :class:`RawMessage`, but for those of the channels ``passed``, and schemas and
    channels; of any record but a part a list of it alone. The messages keep the part's memory and are not
    copied. A damaged part, also one with a wrong checksum, raises exceptions of many types.
    """
    reading = require("mcap.stream_reader", driver="replay", extra="record")
    records = require("mcap.records", driver="replay", extra="record")
    if isinstance(record, records.Message):
        return [RawMessage(record.channel_id, record.log_time, record.data)]
    if not isinstance(record, records.Chunk):
        return [record]
    stream, n_bytes = reading.get_chunk_data_stream(record, validate_crc=True)
    data = memoryview(stream.read(n_bytes))
    made, at = list[Any](), 0
    message_kind, record_at, message_at = (
        int(reading.Opcode.MESSAGE),
        _RECORD.unpack_from,
        _MESSAGE.unpack_from,
    )
    before_record, before_data = _RECORD.size, _MESSAGE.size
    while at < n_bytes:
        kind, length = record_at(data, at)
        begins = at + before_record
        at = begins + length
        if at > n_bytes:
            raise EOFError("a record ends behind its part of the file")
        if kind == message_kind:
            channel, _, log_ns, _ = message_at(data, begins)
            if channel not in passed:
                made.append(RawMessage(channel, log_ns, data[begins + before_data : at]))
        elif kind in {reading.Opcode.CHANNEL, reading.Opcode.SCHEMA}:
            read = records.Channel.read if kind == reading.Opcode.CHANNEL else records.Schema.read
            made.append(read(reading.ReadDataStream(io.BytesIO(data[begins:at]))))
    return made


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
