"""Re-encode a recording's images as JPEG into a copy of it; every other record is copied unchanged."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tega.errors import RecordingError
from tega.recording.foreign import no_session
from tega.recording.mcap_copy import McapCopy, McapItem, McapRecords
from tega.recording.mcap_folder import SessionFolder, recorded_task, session_files
from tega.recording.mcap_reader import Message, open_recording, read_picture
from tega.recording.origin import new_session, note_copy, origin, span
from tega.runtime.files.foreign_file import reports_damage
from tega.runtime.files.whole_file import new_file
from tega.runtime.lifecycle import require
from tega.runtime.opencv import load_cv2


def encode_session(session: Path, *, out: Path, quality: int) -> list[Path]:
    """Copy recordings, one or those of a session's folder, with JPEG pictures of ``quality``, 1 to 100.

    ``out`` becomes a session's folder: new or empty, else ``ConfigError``. Returns the new recordings.
    """
    files = session_files(session)
    new_session(out)
    made = []
    for number, path in enumerate(files, start=1):
        note_copy(path, out)
        target = out / f"trial-{number:03d}.mcap"
        _encode(path, target, quality)
        made.append(target)
    return made


@reports_damage
def _encode(source: Path, target: Path, quality: int) -> None:
    tables = _tables(source)
    if "epoch_ns" not in tables.get("tega", {}):
        raise no_session(source, tables)
    name, step = origin(tables, source, made_by=f"encode --quality {quality}", part=span(tables))
    pictures = _SmallerPictures(quality)
    with open_recording(source) as old, new_file(target) as file:
        copy, records = McapCopy(file), McapRecords(old)
        copy.table(name, step)
        for item in records:
            copy.take(pictures.smaller(item))
        copy.finish()
    if records.problem:
        raise RecordingError(f"{source.name}: cannot be read to its end: {records.problem}", "trim it before")
    task = recorded_task(source)
    facts: dict[str, Any] = {"state": "encoded", "lossless": False, "origin": step}
    SessionFolder(target.parent).note(target.name, facts if task is None else facts | {"task": task})


def _tables(source: Path) -> dict[str, dict[str, str]]:
    tables: dict[str, dict[str, str]] = {}
    with open_recording(source) as file:
        for item in McapRecords(file):
            if item.kind == "Metadata":
                tables.setdefault(item.record.name, {}).update(item.record.metadata)
    return tables


class _SmallerPictures:
    """Encodes the images, and passes on everything else."""

    def __init__(self, quality: int) -> None:
        self._cv2 = load_cv2("recording")
        self._quality = [self._cv2.IMWRITE_JPEG_QUALITY, quality]
        self._made = require("foxglove.messages", driver="recording", extra="record").CompressedImage
        self._schema = self._made.get_schema()

    def smaller(self, item: McapItem) -> McapItem:
        """Return an item with a smaller picture; any other as it is, but for the table that says so."""
        record = item.record
        if item.kind == "Metadata" and record.name == "tega":
            record.metadata = {**record.metadata, "lossless": "false"}
        topic = "" if item.channel is None else item.channel.topic
        if not (topic.startswith("/tactile/") and topic.endswith("/image")):
            return item
        value = item.decoded()
        image = read_picture(Message(topic, item.schema.name, record.log_time, len(record.data), value))
        _, data = self._cv2.imencode(".jpg", image, self._quality)
        stamp = require("foxglove.messages", driver="recording", extra="record").Timestamp(
            value.timestamp.seconds, value.timestamp.nanos
        )
        made = self._made(timestamp=stamp, frame_id=value.frame_id, data=data.tobytes(), format="jpeg")
        record.data = made.encode()
        return item._replace(schema=self._schema)
