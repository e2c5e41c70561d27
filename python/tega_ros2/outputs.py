"""Give ROS 2 a recording as a bag, or a run live by DDS: the same topics and messages.

A bag, ``--format ros2``, is MCAP with CDR messages, and ``metadata.yaml``.
"""

from __future__ import annotations

import json
import logging
import shutil
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, Self

from tega.errors import RecordingError
from tega.recording.mcap_folder import recording_stem
from tega.recording.mcap_reader import McapReader, Message, table_ns
from tega.recording.mcap_schemas import decoder, message_class, unit_table
from tega.recording.origin import LEAD_IN, new_session, no_session, note_copy
from tega.recording.record_channels import RecordChannels
from tega.records import HandExchange, Record
from tega.records.bus import Backlog, Bus
from tega.records.schema import own_schema, schema_name
from tega.records.types import record_types
from tega.runtime.files.foreign_file import plain_name, reports_damage
from tega.runtime.threads import run_realtime
from tega.ui.cli.export_format import ExportFormat
from tega_ros2.convert import Converted, Converter
from tega_ros2.dds import DdsNode, loopback_only
from tega_ros2.definitions import load_rosbags

_VERSION = 9

_LOG: Final = logging.getLogger(__name__)
_JPEG_QUALITY: Final = 80
# Records that may wait; the run never does.
_MOST: Final = 2048
# A topic without a subscriber is still published so often: its first message is what makes it known.
_UNHEARD_NS: Final = 1_000_000_000
_SENSOR_KINDS: Final = frozenset({"sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image"})


@reports_damage
def export_bag(path: Path, folder: Path) -> Path:
    """Write one recording as a bag; its folder must not exist yet.

    Topics have the recording's names. Viewers' schemas become standard messages, TEGA's own records become
    messages of ``tega_msgs``; the bag holds their definitions, with units as comments. Messages are in the
    order and have the log times of the recording; headers have the time of the record. A message that has no
    form in ROS 2 raises :class:`RecordingError`; no bag is left behind.
    """
    bags = load_rosbags("rosbag2")
    reader = McapReader(path)
    writer = bags.Writer(folder, version=_VERSION, storage_plugin=bags.StoragePlugin.MCAP)
    try:
        with writer:
            _write(reader, writer)
            for name, table in reader.metadata.items():
                if name != "units":  # they are in the definitions
                    writer.set_custom_data(f"tega.{name}", json.dumps(table))
        attached = folder / "attachments"
        for name, data in reader.files.items():
            if name != LEAD_IN:
                attached.mkdir(exist_ok=True)
                (attached / plain_name(name, subject="attachment", source=path.name)).write_bytes(data)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    note_copy(path, folder)
    return folder


def _write(reader: McapReader, writer: Any) -> None:
    converter: Converter | None = None
    connections: dict[str, tuple[str, Any]] = {}
    for message in reader.messages():
        if converter is None:
            epoch_ns = table_ns(reader.metadata.get("tega", {}), "epoch_ns")
            if epoch_ns is None:
                raise no_session(reader.path, reader.metadata)
            converter = Converter(reader.path.name, epoch_ns)
            converter.definitions.set_units(reader.metadata.get("units", {}))
        definitions = converter.definitions
        for topic, kind, value in converter.convert(message):
            if topic not in connections:
                connection = writer.add_connection(
                    topic, kind, msgdef=definitions.text(kind), rihs01=definitions.store.hash_rihs01(kind)
                )
                connections[topic] = kind, connection
            known, connection = connections[topic]
            if known != kind:
                raise RecordingError(
                    f"{reader.path.name}: topic {topic!r} has {known} and {kind}", "inspect the recording"
                )
            writer.write(connection, message.log_ns, definitions.store.serialize_cdr(value, kind))
    if converter is None:
        raise RecordingError(f"{reader.path.name}: holds no message", "the run had not begun")
    reader.warn_cut()


def _export(recordings: Sequence[Path], out: Path) -> list[Path]:
    new_session(out)
    return [export_bag(path, out / recording_stem(path)) for path in recordings]


FORMAT = ExportFormat(options=(), export=_export)


class Ros2Stream:
    """Publishes a run's records as ROS 2 does; use as a context manager.

    Pictures have the QoS of sensor data (best effort), everything else ROS 2's default (reliable, volatile,
    depth 10). A record waits in a queue for a thread of its own; the oldest is dropped when the queue is
    full, and a message is dropped that a subscriber does not acknowledge in time. ``url`` is the domain,
    empty while closed; ``n_dropped`` counts messages that were dropped for slow subscribers and, when closed,
    the records dropped before.
    """

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._node: DdsNode
        self._converter: Converter
        self._channels: RecordChannels
        self._writers: dict[str, Any] = {}
        self._backlog = Backlog("ros2", most=_MOST, newest=True, rank=run_realtime("beside"))
        self.url, self.n_dropped = "", 0

    def __enter__(self) -> Self:
        """Join the domain and subscribe to the run; errors are those of :class:`tega_ros2.dds.DdsNode`."""
        self._converter = Converter("ros2", 0)
        definitions = self._converter.definitions
        definitions.set_units(unit_table())
        node = self._node = DdsNode(definitions)
        self._channels = RecordChannels(lossless=False, jpeg_quality=_JPEG_QUALITY, open_channel=self._open)
        kinds = [kind for kind in record_types() if kind.topic and kind is not HandExchange]
        for kind in filter(own_schema, kinds):  # now, so that no type is built while the loop runs
            node.prepare(definitions.own(message_class(schema_name(kind)).DESCRIPTOR))
        self.url = f"domain {node.domain_id}" + (", this machine" if loopback_only() else "")
        for kind in kinds:
            self._bus.subscribe(kind, self._take, name="ros2", backlog=self._backlog)
        return self

    def __exit__(self, *_error: object) -> None:
        """Leave the domain."""
        self._backlog.close()
        self.url = ""
        self._node.close()
        self._writers.clear()  # they end once nothing refers to them, as their participant does
        del self._node, self._channels
        self.n_dropped += self._backlog.n_dropped
        if self.n_dropped:
            _LOG.warning("ros2: %d messages dropped: a subscriber did not keep up", self.n_dropped)

    def _take(self, record: Record) -> None:
        if self._converter.epoch_ns == 0:
            self._converter.epoch_ns = self._channels.epoch_ns = time.time_ns() - record.log_ns
        self._channels.write(record, record.log_ns)

    def _open(self, topic: str, _make: Any, *, schema: Any = None, **_how: Any) -> _Channel:
        return _Channel(self, topic, schema)

    def publish(self, message: Message) -> list[Any]:
        """Convert and write a message; return the writers of everything that was made of it."""
        return [self._write(made) for made in self._converter.convert(message)]

    def _write(self, made: Converted) -> Any:
        writer = self._writers.get(made.topic)
        if writer is None:
            sensor = made.kind in _SENSOR_KINDS
            writer = self._writers[made.topic] = self._node.writer(made.topic, made.kind, sensor=sensor)
        cdr = self._converter.definitions.store.serialize_cdr(made.value, made.kind)
        self.n_dropped += not self._node.write(writer, bytes(cdr))
        return writer


class _Channel:
    """Channel of one topic, in place of one of the SDK's."""

    def __init__(self, stream: Ros2Stream, topic: str, schema: Any) -> None:
        self._stream, self._topic, self._schema = stream, topic, schema
        self._writers: dict[int, Any] = {}
        self._sent_ns = 0

    def has_sinks(self) -> bool:
        """Return whether anybody subscribes, or the next message is due that makes the topic known."""
        if time.monotonic_ns() - self._sent_ns >= _UNHEARD_NS:
            return True
        return any(writer.get_matched_subscriptions() for writer in self._writers.values())

    def log(self, message: Any, *, log_time: int) -> None:
        """Publish a message: bytes of TEGA's own, or a message of the SDK."""
        if not self.has_sinks():
            return
        self._sent_ns = time.monotonic_ns()
        if self._schema is None:
            self._schema = type(message).get_schema()
        data = message if isinstance(message, bytes) else message.encode()
        value = decoder(self._schema.name, self._schema.data).FromString(data)
        made = Message(self._topic, self._schema.name, log_time, len(data), value)
        self._writers |= {id(writer): writer for writer in self._stream.publish(made)}
