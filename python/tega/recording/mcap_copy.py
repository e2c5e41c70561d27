"""Copy records from one MCAP file into another as they are."""

from __future__ import annotations

from collections.abc import Iterator
from typing import IO, Any, NamedTuple

from tega.recording.mcap_reader import MOST_RECORD
from tega.recording.mcap_schemas import decoder
from tega.runtime.lifecycle import require


class McapItem(NamedTuple):
    """A message, an attachment or a table, as the public stream reader gives it.

    ``kind`` is ``Message``, ``Attachment`` or ``Metadata``, ``record`` not yet decoded. A message has a
    channel, and a schema or none.
    """

    kind: str
    record: Any
    channel: Any = None
    schema: Any = None

    def decoded(self) -> Any:
        """Return a protobuf message's content."""
        return decoder(self.schema.name, self.schema.data).FromString(self.record.data)


class McapRecords:
    """Records of a file, in the order in which they were written, as far as the file can be read.

    It needs no index. ``problem`` is the reason why the rest cannot be read; ``""`` for none.
    """

    def __init__(self, file: IO[bytes]) -> None:
        reading = require("mcap.stream_reader", driver="recording", extra="record")
        self._reader = reading.StreamReader(file, validate_crcs=True, record_size_limit=MOST_RECORD)
        self.problem = ""

    def __iter__(self) -> Iterator[McapItem]:
        """Return an iterator over the messages, attachments and tables."""
        schemas: dict[int, Any] = {}
        channels: dict[int, Any] = {}
        source = iter(self._reader.records)
        while True:
            try:
                record = next(source)
            except StopIteration:
                return
            except Exception as error:  # whatever the damage makes the reader say: all before it is good
                self.problem = type(error).__name__
                return
            kind = type(record).__name__
            if kind == "Schema":
                schemas[record.id] = record
            elif kind == "Channel":
                channels[record.id] = record
            elif kind == "Message" and record.channel_id in channels:
                channel = channels[record.channel_id]
                yield McapItem(kind, record, channel, schemas.get(channel.schema_id))
            elif kind in {"Attachment", "Metadata"}:
                yield McapItem(kind, record)


class McapCopy:
    """A new file with an index, which takes records out of others; the caller closes the file.

    ``writer`` is that of the package ``mcap``, to add tables and attachments. ``end_ns``
    is the log time of the newest message, nanoseconds since 1970; 0 when there is none.
    """

    def __init__(self, file: IO[bytes]) -> None:
        writing = require("mcap.writer", driver="recording", extra="record")
        self.writer = writing.Writer(file, compression=writing.CompressionType.ZSTD)
        self.writer.start(library="tega")
        self._schemas: dict[tuple[str, bytes], int] = {}
        self._channels: dict[tuple[str, int], int] = {}
        self.n_messages = self.end_ns = 0

    def take(self, item: McapItem) -> None:
        """Write one."""
        record, writer = item.record, self.writer
        if item.kind == "Message":
            writer.add_message(
                self._channel(item), record.log_time, record.data, record.publish_time, record.sequence
            )
            self.n_messages, self.end_ns = self.n_messages + 1, max(self.end_ns, record.log_time)
        elif item.kind == "Attachment":
            writer.add_attachment(
                record.create_time, record.log_time, record.name, record.media_type, record.data
            )
        else:
            writer.add_metadata(record.name, record.metadata)

    def finish(self) -> None:
        """Write the index."""
        self.writer.finish()

    def _channel(self, item: McapItem) -> int:
        schema = 0
        if item.schema is not None:
            name, encoding, data = item.schema.name, item.schema.encoding, item.schema.data
            if (name, data) not in self._schemas:
                self._schemas[name, data] = self.writer.register_schema(name, encoding, data)
            schema = self._schemas[name, data]
        place = (item.channel.topic, schema)
        if place not in self._channels:
            self._channels[place] = self.writer.register_channel(
                item.channel.topic, item.channel.message_encoding, schema, item.channel.metadata
            )
        return self._channels[place]
