"""Keep a session's folder: an MCAP file per run, an index, and recovery of files that were never finished."""

from __future__ import annotations

import contextlib
import re
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from tega.errors import ConfigError, RecordingError
from tega.recording.disk import take_tail
from tega.recording.mcap_copy import McapCopy, McapRecords
from tega.recording.mcap_reader import open_recording
from tega.runtime.files.foreign_file import parse_json, read_words
from tega.runtime.files.whole_file import lock_file, new_file, write_whole

INDEX_NAME = "session.json"
INDEX_FORMAT = "tega-session"
_PART = ".part"
_LEAVES_S, _TRIES_S = 1.0, 0.02
_NUMBER = re.compile(r"trial-([0-9]{3,12})\.mcap")


class _IndexTrial(msgspec.Struct):
    """Names a trial's file; all else of the trial in the index stays as it is."""

    file: str


class _SessionIndex(msgspec.Struct):
    trials: list[_IndexTrial]


class Recovered(NamedTuple):
    """Result of recovering an unfinished file.

    Attributes:
        end_ns: Log time of the newest message, nanoseconds since 1970; 0 when there is none.
        problem: Reason why the rest cannot be read.
    """

    path: Path
    n_messages: int
    end_ns: int
    problem: str


class SessionFolder:
    """A folder of trials, made if need be; ``ConfigError`` if it holds something that is not a session.

    Opening it finishes the files that an earlier process left unfinished (``recovered``). With ``to_read``
    those that cannot be, for lack of room or of the right to write, may stay as they are (``unfinished``).
    """

    def __init__(self, path: Path, *, to_read: bool = False) -> None:
        if path.exists() and not path.is_dir():
            raise ConfigError(f"session folder {path.name!r} is a file", "name a folder")
        self.path = path.absolute()  # of "." a message names the folder
        known = (path / INDEX_NAME).exists() or any(path.glob("*.mcap*" if to_read else "trial-*.mcap*"))
        if path.is_dir() and any(path.iterdir()) and not known:
            if to_read:
                raise no_recording(path)
            raise ConfigError(
                f"session folder {path.name!r} is not empty and holds no session",
                "name a new or empty folder, or one with the session.json of an earlier recording",
            )
        try:
            path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            problem = f"{path}: no folder can be made there: {error.strerror}"
            raise RecordingError(problem, "name a folder that you may write to") from error
        self.unfinished: list[Path] = []
        self._to_read = to_read
        self.recovered = self._recover()

    def new_trial(self) -> Path:
        """Return the path of the next trial's file, new; while it is written it ends in ``.part``."""
        self.index()
        numbers = (_NUMBER.match(file.name) for file in self.path.iterdir())
        taken = [int(number[1]) for number in numbers if number is not None]
        return self.path / f"trial-{max(taken, default=0) + 1:03d}.mcap"

    def note(self, name: str, facts: dict[str, Any]) -> None:
        """Write facts about a trial into the index, which is replaced as a whole or not at all."""
        index = self.index()
        trials = {trial["file"]: trial for trial in index["trials"]}
        trials[name] = {"file": name, **trials.get(name, {}), **facts}
        index["trials"] = [trials[key] for key in sorted(trials, key=in_order)]
        self._write(index)

    def discard(self, name: str) -> None:
        """Delete a trial's file, finished or not, and its entry in the index; missing ones are ignored.

        A name that is not that of a trial is ``RecordingError``.
        """
        if _NUMBER.fullmatch(name) is None:
            raise RecordingError(
                f"{name!r} is no trial of {self.path.name}", "name one such as trial-001.mcap"
            )
        index = self.index()
        index["trials"] = [trial for trial in index["trials"] if trial["file"] != name]
        self._write(index)
        for file in (self.path / name, self.path / f"{name}{_PART}"):
            file.unlink(missing_ok=True)

    def finished(self, name: str) -> bool:
        """Return whether a trial's file exists; an unfinished one is recovered first."""
        if (self.path / f"{name}{_PART}").exists():
            self.recovered += self._recover()
        return (self.path / name).is_file()

    def begin(self) -> None:
        """Have an index be there, so that the folder is known as a session's before its first trial."""
        self._write(self.index())

    def label(self, task: str, names: Sequence[str] = ()) -> list[str]:
        """Write the task of trials, in words, into the index; their files are unchanged.

        Returns the files: those of ``names``, all where it is empty; missing ones, or none at all, are
        refused.
        """
        there = sorted((file.name for file in self.path.glob("trial-*.mcap")), key=in_order)
        missing = [name for name in names if name not in there]
        if missing or not there:
            raise RecordingError(
                f"{self.path.name}: holds no {missing[0] if missing else 'recording'}",
                f"it has {', '.join(there) or 'none'}",
            )
        for name in (chosen := list(names) or there):
            self.note(name, {"task": task})
        return chosen

    def _write(self, index: dict[str, Any]) -> None:
        write_whole(self.path / INDEX_NAME, msgspec.json.format(msgspec.json.encode(index), indent=2) + b"\n")

    def index(self) -> dict[str, Any]:
        """Return the index as it stands; ``RecordingError`` where it is damaged."""
        return _index(self.path)

    def _recover(self) -> list[Recovered]:
        done = []
        for part in sorted(self.path.glob(f"trial-*.mcap{_PART}")):
            if part.is_symlink() or not part.is_file():
                continue  # nothing that a recording left behind
            try:
                done += self._recover_one(part)
            except OSError:
                if not self._to_read:
                    raise
                self.unfinished.append(part)
        return done

    def _recover_one(self, part: Path) -> list[Recovered]:
        """Finish one file; returns an empty list if it is still being written."""
        with part.open("rb") as file:
            end_s = time.monotonic() + _LEAVES_S
            while not lock_file(file, part):  # the recorder's process of a killed run leaves it soon
                if time.monotonic() >= end_s:
                    return []
                time.sleep(_TRIES_S)
            take_tail(part)
        recovered = recover_file(part, part.with_suffix(""))
        part.unlink()
        facts = {"state": "recovered", "messages": recovered.n_messages, "problem": recovered.problem}
        with contextlib.suppress(RecordingError):  # a damaged index keeps no recording from being finished
            self.note(recovered.path.name, facts)
        return [recovered]


def _index(folder: Path) -> dict[str, Any]:
    try:
        index = parse_json(read_words(folder / INDEX_NAME, most_mib=64), dict[str, Any])
        msgspec.convert(index, _SessionIndex)
    except FileNotFoundError:
        return {"format": INDEX_FORMAT, "version": 1, "trials": []}
    except (OSError, UnicodeDecodeError, msgspec.DecodeError) as error:
        raise RecordingError(
            f"{folder.absolute().name}/{INDEX_NAME}: no index of a session: {error}",
            "fix it or restore it from a copy; if you move it away, a new one starts without the entries of its trials",
        ) from error
    return index


def recorded_task(recording: Path) -> str | None:
    """Return the task of a recording from the index beside it; ``None`` if there is none."""
    return noted(recording, "task") or None


def note_made(source: Path, target: Path, *, state: str, lossless: bool, step: dict[str, str]) -> None:
    """Write into the index how a recording was made out of another, whose task it keeps."""
    facts: dict[str, Any] = {"state": state, "lossless": lossless, "origin": step}
    if task := recorded_task(source):
        facts["task"] = task
    SessionFolder(target.parent).note(target.name, facts)


def noted(recording: Path, key: str) -> str:
    """Return a text about a recording from the index beside it; ``""`` if there is none."""
    with contextlib.suppress(RecordingError):
        for trial in _index(recording.parent)["trials"]:
            if trial["file"] == recording.name.removesuffix(_PART):
                text = trial.get(key)
                return text if isinstance(text, str) else ""
    return ""


def in_order(name: str) -> tuple[int, str]:
    """Sort key of a session's files: trial 1000 comes after trial 999."""
    number = _NUMBER.match(name)
    return (0 if number is None else int(number[1]), name)


def recording_stem(recording: Path) -> str:
    """Return a recording's name without its endings, those of an unfinished one among them."""
    return Path(recording.name.removesuffix(_PART)).stem


def recover_file(source: Path, target: Path) -> Recovered:
    """Copy everything readable of an MCAP file into one with an index; stops at the first damage.

    The source was left by a killed writer or truncated; ``RecordingError`` where it is larger than a
    recording can be. The target is replaced, and appears only when it is complete.
    """
    with open_recording(source) as old, new_file(target) as file:
        # A file killed before its first flush has nothing, not even a header: the copy has one all the same.
        copy, records = McapCopy(file), McapRecords(old)
        for record in records:
            copy.take(record)
        copy.finish()
    return Recovered(target, copy.n_messages, copy.end_ns, records.problem)


def no_recording(folder: Path) -> RecordingError:
    """Return the error for a folder without a recording; the folder of a run's tables is named as that."""
    tables = any((folder / name).is_file() for name in ("summary.json", "contacts.csv", "vest.csv"))
    text = "holds a run's tables, not a recording" if tables else "holds no recording"
    return RecordingError(
        f"{folder.absolute().name}: {text}", "record a run with --record DIR, then name DIR"
    )


def session_files(path: Path) -> list[Path]:
    """Return the recordings that a path names: a file, or all of a session's folder, at least one.

    Unfinished ones are finished first. Without room or permission for that they are returned unfinished: they
    can be read up to their end.
    """
    if path.is_dir():
        folder = SessionFolder(path, to_read=True)
        files = [*path.glob("*.mcap"), *(part for part in folder.unfinished if part.exists())]
        files.sort(key=lambda file: in_order(file.name.removesuffix(_PART)))
        if not files:
            raise no_recording(path)
        return files
    if not path.is_file():
        raise RecordingError(f"{path.name}: there is no such recording", f"looked for {path}")
    return [path]


def one_recording(path: Path) -> Path:
    """Return the recording that a path names: a file, or the only one of a session's folder."""
    files = session_files(path)
    if len(files) > 1:
        names = ", ".join(file.name for file in files)
        raise RecordingError(
            f"{path.absolute().name}: holds {len(files)} recordings, and this takes one",
            f"name one of them: {names}",
        )
    return files[0]
