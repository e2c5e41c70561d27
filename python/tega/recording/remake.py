"""Make recordings out of others: merge those of several sessions into one, or re-encode their images as JPEG.

Every other record is copied as it is.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from operator import attrgetter
from pathlib import Path
from typing import NamedTuple

from tega.errors import RecordingError
from tega.recording.mcap_copy import McapCopy, McapItem, McapRecords
from tega.recording.mcap_folder import note_made, session_files
from tega.recording.mcap_index import open_indexed
from tega.recording.mcap_reader import McapReader, Message, open_recording, read_picture
from tega.recording.origin import Tables, new_session, note_copy, origin, span
from tega.runtime.files.foreign_file import reports_damage
from tega.runtime.files.whole_file import new_file
from tega.runtime.lifecycle import require
from tega.runtime.opencv import load_cv2

_HINT = "merge only recordings of one setup; keep the others apart"


class _Part(NamedTuple):
    """A recording that is to be merged.

    ``from_ns`` and ``to_ns`` are the times of day of its beginning and its newest message, nanoseconds since
    1970; ``tables`` are its metadata, ``calibration`` its maxima, as text.
    """

    path: Path
    name: str
    from_ns: int
    to_ns: int
    tables: Tables
    calibration: bytes

    def setup(self) -> dict[str, str]:
        """Return the values that have to be the same in all of them, by name."""
        head = self.tables["tega"]
        sources = ", ".join(sorted(self.tables.get("sources", {})))
        known = {"format": head.get("version", ""), "vest": head.get("layout", ""), "inputs": sources}
        return {**known, **self.tables.get("versions", {})}


def merge_sessions(sessions: list[Path], *, out: Path) -> list[Path]:
    """Copy all recordings of several sessions into a new one, in order of time, one file each.

    The recordings, at least two in all, are unchanged, so each one replays as before; their metadata name
    their origin. ``out`` is new or empty, else ``ConfigError``. ``RecordingError`` if two hold the same time,
    or they differ in versions, calibration, vest or inputs.
    """
    found = (_part(path) for session in sessions for path in session_files(session))
    parts = sorted(found, key=attrgetter("from_ns"))
    if len(parts) < 2:
        raise RecordingError("there is only one recording", "name two sessions or more")
    first = parts[0]
    for before, part in pairwise(parts):
        _fit(first, part)
        if _share_time(before, part):
            over_s = (min(before.to_ns, part.to_ns) - part.from_ns) / 1e9
            raise RecordingError(
                f"{before.name} and {part.name} overlap by {over_s:.3f} s of the same time",
                "leave one of them out, or trim them apart",
            )
    new_session(out)
    for part in parts:
        note_copy(part.path, out)
    return [_copy(part.path, part.tables, out / f"trial-{k:03d}.mcap") for k, part in enumerate(parts, 1)]


def _share_time(before: _Part, part: _Part) -> bool:
    """Whether two parts hold the same time; a run that did not wait for the clock counts a time of its own, from 0."""
    if part.from_ns >= before.to_ns:
        return False
    heads = [one.tables["tega"] for one in (before, part)]
    waited = all(head.get("start_ns", "") != "0" for head in heads)
    return waited or heads[0]["epoch_ns"] == heads[1]["epoch_ns"]


@reports_damage
def _part(path: Path) -> _Part:
    reader, name = open_indexed(path), f"{path.resolve().parent.name}/{path.name}"
    tables = reader.session_tables()
    if not reader.indexed:
        raise RecordingError(f"{name}: has no index", "name its session's folder to have it finished")
    # A trimmed one has pictures from just before its beginning too.
    from_ns = max(reader.from_ns, int(tables["tega"]["epoch_ns"]) + span(tables).from_ns)
    return _Part(path, name, from_ns, reader.until_ns, tables, reader.files.get("calibration.toml", b""))


def _fit(first: _Part, part: _Part) -> None:
    ours, theirs = first.setup(), part.setup()
    differ = [
        f"{name} {ours.get(name, 'unknown')} and {theirs.get(name, 'unknown')}"
        for name in {**ours, **theirs}
        if ours.get(name) != theirs.get(name)
    ]
    if first.calibration != part.calibration:
        differ.append("another calibration")
    if differ:
        raise RecordingError(f"{first.name} and {part.name} do not fit together: {', '.join(differ)}", _HINT)


@reports_damage
def _copy(source: Path, tables: Tables, target: Path) -> Path:
    step = _copied(source, target, tables, "merge", lambda item: item)
    lossless = tables["tega"].get("lossless") == "true"
    note_made(source, target, state="merged", lossless=lossless, step=step)
    return target


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
    tables = McapReader(source).session_tables()
    step = _copied(source, target, tables, f"encode --quality {quality}", _smaller(quality))
    note_made(source, target, state="encoded", lossless=False, step=step)


def _copied(
    source: Path, target: Path, tables: Tables, made_by: str, changed: Callable[[McapItem], McapItem]
) -> dict[str, str]:
    """Copy each record, changed or not, and return the step of the origin; of a damaged one no file is made."""
    name, step = origin(tables, source, made_by=made_by, part=span(tables))
    with open_recording(source) as old, new_file(target) as file:
        copy, records = McapCopy(file), McapRecords(old)
        copy.writer.add_metadata(name, step)
        for item in records:
            copy.take(changed(item))
        if records.problem:
            raise RecordingError(
                f"{step['session']}/{source.name}: cannot be read to its end: {records.problem}",
                "trim it before",
            )
        copy.finish()
    return step


def _smaller(quality: int) -> Callable[[McapItem], McapItem]:
    """Return a function that makes a picture smaller; any other item stays as it is, but for the table that says so."""
    cv2, messages = load_cv2("recording"), require("foxglove.messages", driver="recording", extra="record")
    how, schema = [cv2.IMWRITE_JPEG_QUALITY, quality], messages.CompressedImage.get_schema()

    def smaller(item: McapItem) -> McapItem:
        record = item.record
        if item.kind == "Metadata" and record.name == "tega":
            record.metadata = {**record.metadata, "lossless": "false"}
        topic = "" if item.channel is None else item.channel.topic
        if not (topic.startswith("/tactile/") and topic.endswith("/image")):
            return item
        value = item.decoded()
        image = read_picture(Message(topic, item.schema.name, record.log_time, len(record.data), value))
        made = messages.CompressedImage(
            timestamp=messages.Timestamp(value.timestamp.seconds, value.timestamp.nanos),
            frame_id=value.frame_id,
            data=cv2.imencode(".jpg", image, how)[1].tobytes(),
            format="jpeg",
        )
        record.data = made.encode()
        return item._replace(schema=schema)

    return smaller
