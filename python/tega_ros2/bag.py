"""Write a recording as a ROS 2 bag, ``--format ros2``: MCAP with CDR messages, and ``metadata.yaml``."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tega.errors import RecordingError
from tega.recording.mcap_reader import McapReader, table_ns
from tega.recording.origin import LEAD_IN, new_session, no_session, note_copy
from tega.runtime.files.foreign_file import plain_name, reports_damage
from tega.ui.cli.export_format import ExportFormat
from tega_ros2.convert import Converter
from tega_ros2.definitions import load_rosbags

_VERSION = 9


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


def _export(recordings: Sequence[Path], out: Path) -> list[Path]:
    new_session(out)
    return [export_bag(path, out / path.stem) for path in recordings]


FORMAT = ExportFormat(options=(), export=_export)
