"""A session's folder: one MCAP file per run, an index of them, and what to do with one that was never finished."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

from tega.devices.lifecycle import require
from tega.errors import ConfigError, RecordingError
from tega.recording.mcap_file import lock

__all__ = ["INDEX_NAME", "Recovered", "SessionFolder", "recover_file", "session_files"]

INDEX_NAME = "session.json"
INDEX_FORMAT = "tega-session"
_PART = ".part"


class Recovered(NamedTuple):
    """What became of an unfinished file.

    Attributes:
        path: The finished one.
        n_messages: Messages in it.
        end_ns: Log time of the newest, nanoseconds since 1970; 0 when there is none.
        problem: Why the rest of it cannot be read.
    """

    path: Path
    n_messages: int
    end_ns: int
    problem: str


class SessionFolder:
    """A folder of trials.

    Opening it finishes what an earlier process left unfinished.

    Args:
        path: The folder; made if need be.

    Raises:
        ConfigError: It is a file, or holds something that is not a session.

    Attributes:
        recovered: What was finished on opening.
    """

    def __init__(self, path: Path) -> None:
        if path.exists() and not path.is_dir():
            raise ConfigError(f"session folder {path.name!r} is a file", "name a folder")
        self.path = path
        if path.is_dir() and any(path.iterdir()) and not self._is_session():
            raise ConfigError(
                f"session folder {path.name!r} is not empty and holds no session",
                "name a new or empty folder, or one with the session.json of an earlier recording",
            )
        path.mkdir(parents=True, exist_ok=True)
        self.recovered = self._recover()

    def new_trial(self) -> Path:
        """Return the path of the next trial's file, which does not exist; while it is written it ends in ``.part``."""
        taken = [int(p.name[6:9]) for p in self.path.glob("trial-[0-9][0-9][0-9].mcap*")]
        return self.path / f"trial-{max(taken, default=0) + 1:03d}.mcap"

    def note(self, name: str, facts: dict[str, Any]) -> None:
        """Write into the index what is known of a trial; the index is replaced as a whole or not at all."""
        index = self.index()
        trials = {trial["file"]: trial for trial in index["trials"]}
        trials[name] = {"file": name, **trials.get(name, {}), **facts}
        index["trials"] = [trials[key] for key in sorted(trials)]
        new = self.path / f"{INDEX_NAME}.new"
        new.write_text(json.dumps(index, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
        new.replace(self.path / INDEX_NAME)

    def index(self) -> dict[str, Any]:
        """Return the index as it stands."""
        try:
            index = json.loads((self.path / INDEX_NAME).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            index = None
        if not isinstance(index, dict) or not isinstance(index.get("trials"), list):
            return {"format": INDEX_FORMAT, "version": 1, "trials": []}
        return index

    def _is_session(self) -> bool:
        return (self.path / INDEX_NAME).exists() or any(self.path.glob("trial-*.mcap*"))

    def _recover(self) -> list[Recovered]:
        done = []
        for part in sorted(self.path.glob(f"trial-*.mcap{_PART}")):
            with part.open("rb") as file:
                if not lock(file):
                    continue  # somebody is writing it
            recovered = recover_file(part, part.with_suffix(""))
            part.unlink()
            done.append(recovered)
            facts = {"state": "recovered", "messages": recovered.n_messages, "problem": recovered.problem}
            self.note(recovered.path.name, facts)
        return done


def recover_file(source: Path, target: Path) -> Recovered:
    """Copy everything readable of an MCAP file into one with an index; stops at the first damage.

    Args:
        source: A file whose writer was killed, or one that was cut short.
        target: The new file; it is replaced, and appears only when it is complete.

    Returns:
        What was found.

    Raises:
        MissingExtraError: The package ``mcap`` is not installed.
    """
    reading = require("mcap.stream_reader", driver="recording", extra="record")
    records = require("mcap.records", driver="recording", extra="record")
    writing = require("mcap.writer", driver="recording", extra="record")
    new = target.with_name(f"{target.name}.recovering")
    n_messages = end_ns = 0
    problem = ""
    with source.open("rb") as old, new.open("wb") as file:
        writer = writing.Writer(file, compression=writing.CompressionType.ZSTD)
        # A file killed before its first flush has nothing, not even a header.
        writer.start(library="tega")
        schemas: dict[int, int] = {0: 0}
        channels: dict[int, int] = {}
        try:
            for record in reading.StreamReader(old).records:
                if isinstance(record, records.Schema):
                    if record.id not in schemas:
                        schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
                elif isinstance(record, records.Channel):
                    if record.id not in channels:
                        channels[record.id] = writer.register_channel(
                            record.topic, record.message_encoding, schemas[record.schema_id], record.metadata
                        )
                elif isinstance(record, records.Message):
                    writer.add_message(
                        channels[record.channel_id],
                        record.log_time,
                        record.data,
                        record.publish_time,
                        record.sequence,
                    )
                    n_messages, end_ns = n_messages + 1, max(end_ns, record.log_time)
                elif isinstance(record, records.Attachment):
                    writer.add_attachment(
                        record.create_time, record.log_time, record.name, record.media_type, record.data
                    )
                elif isinstance(record, records.Metadata):
                    writer.add_metadata(record.name, record.metadata)
        except Exception as error:  # whatever the damage makes the reader say: all before it is good
            problem = type(error).__name__
        writer.finish()
    new.replace(target)
    return Recovered(target, n_messages, end_ns, problem)


def session_files(path: Path) -> list[Path]:
    """Return the recordings that a path names: a file, or all of a session's folder, unfinished ones finished first.

    Raises:
        RecordingError: There are none.
    """
    if path.is_dir():
        files = sorted(SessionFolder(path).path.glob("*.mcap"))
        if not files:
            raise RecordingError(
                f"{path.name}: holds no recording", "name a session's folder, or a file in it"
            )
        return files
    if not path.is_file():
        raise RecordingError(f"{path.name}: there is no such recording", f"looked for {path}")
    return [path]
