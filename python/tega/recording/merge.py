"""Merge the recordings of several sessions into one session, in order of time, each as it is."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

from tega.errors import RecordingError
from tega.recording.foreign import no_session
from tega.recording.mcap_copy import McapCopy, McapRecords
from tega.recording.mcap_folder import SessionFolder, session_files
from tega.recording.mcap_reader import MOST_RECORD, open_recording
from tega.recording.origin import new_session, note_copy, origin, span
from tega.runtime.files.foreign_file import reports_damage
from tega.runtime.files.whole_file import new_file
from tega.runtime.lifecycle import require

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
    tables: dict[str, dict[str, str]]
    calibration: bytes

    def setup(self) -> dict[str, str]:
        """Return the values that have to be the same in all of them, by name."""
        head = self.tables["tega"]
        sources = ", ".join(sorted(self.tables.get("sources", {})))
        known = {"format": head.get("version", ""), "vest": head.get("layout", ""), "inputs": sources}
        return known | self.tables.get("versions", {})


@reports_damage
def merge_sessions(sessions: list[Path], *, out: Path) -> list[Path]:
    """Copy all recordings of several sessions into a new one, in order of time, one file each.

    The recordings, at least two in all, are unchanged, so each one replays as before; their metadata name
    their origin. ``out`` is new or empty, else ``ConfigError``. ``RecordingError`` if two hold the same time,
    or they differ in versions, calibration, vest or inputs.
    """
    parts = sorted((_part(path) for session in sessions for path in session_files(session)), key=_begin)
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
    return [_copy(part, out / f"trial-{k:03d}.mcap") for k, part in enumerate(parts, 1)]


def _begin(part: _Part) -> int:
    return part.from_ns


def _share_time(before: _Part, part: _Part) -> bool:
    """Whether two parts hold the same time; a run that did not wait for the clock counts a time of its own, from 0."""
    if part.from_ns >= before.to_ns:
        return False
    heads = [one.tables["tega"] for one in (before, part)]
    waited = all(head.get("start_ns", "") != "0" for head in heads)
    return waited or heads[0]["epoch_ns"] == heads[1]["epoch_ns"]


def _part(path: Path) -> _Part:
    reading: Any = require("mcap.reader", driver="merge", extra="record")
    name = f"{path.resolve().parent.name}/{path.name}"
    tables: dict[str, dict[str, str]] = {}
    file = open_recording(path)
    try:
        with file:
            reader = reading.SeekingReader(file, record_size_limit=MOST_RECORD)
            summary = reader.get_summary()
            for table in reader.iter_metadata():
                tables.setdefault(table.name, {}).update(table.metadata)
            files = {a.name: a.data for a in reader.iter_attachments() if a.name == "calibration.toml"}
    except Exception as error:  # whatever a damaged file makes the reader say
        raise RecordingError(
            f"{name}: cannot be read: {type(error).__name__}", "name its session's folder to have it finished"
        ) from error
    if "epoch_ns" not in tables.get("tega", {}):
        raise no_session(path, tables)
    if summary is None or summary.statistics is None:
        raise RecordingError(f"{name}: has no index", "name its session's folder to have it finished")
    there, times = span(tables), summary.statistics
    # A trimmed one has pictures from just before its beginning too.
    epoch_ns = int(tables["tega"]["epoch_ns"])
    from_ns = max(times.message_start_time, epoch_ns + there.from_ns)
    return _Part(path, name, from_ns, times.message_end_time, tables, files.get("calibration.toml", b""))


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


def _copy(part: _Part, target: Path) -> Path:
    name, step = origin(part.tables, part.path, made_by="merge", part=span(part.tables))
    with open_recording(part.path) as old, new_file(target) as file:
        copy = McapCopy(file)
        copy.table(name, step)
        for item in McapRecords(old):
            copy.take(item)
        copy.finish()
    lossless = part.tables["tega"].get("lossless") == "true"
    facts = {"state": "merged", "lossless": lossless, "origin": step}
    SessionFolder(target.parent).note(target.name, facts)
    return target
