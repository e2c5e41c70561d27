"""Keep a journal of episodes beside their recordings: one JSON object a line, appended and synced one by one."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import IO, Literal, Self

import msgspec

from tega.errors import DeviceUnavailableError, RecordingError
from tega.recording.mcap_folder import SessionFolder
from tega.runtime.files.foreign_file import parse_json, read_foreign
from tega.runtime.files.lock import lock_file
from tega.runtime.files.whole_file import open_to_append

EPISODES = "episodes.jsonl"

EpisodeStep = Literal["begun", "kept", "discarded", "cut"]


class EpisodeLine(msgspec.Struct, frozen=True, omit_defaults=True, forbid_unknown_fields=True):
    """One line of ``episodes.jsonl``.

    Attributes:
        episode: Its number in the folder, from 1; one that was discarded keeps its own.
        step: ``begun``; how it ended; ``cut`` where the program ended before it did, and what there is was kept.
        at_s: When, seconds since 1970.
        file: The recording; a discarded one's name goes to a later episode.
        task: Description of the task.
        duration_s: How long it was.
        why: Why it was discarded, where that was no person.
    """

    episode: int
    step: EpisodeStep
    at_s: float
    file: str = ""
    task: str = ""
    duration_s: float | None = None
    why: str = ""


def read_episodes(folder: Path) -> list[EpisodeLine]:
    """Read a folder's journal; a last line that was cut off is passed over, a missing file holds none.

    Raises:
        RecordingError: Another line is none.
    """
    path = folder / EPISODES
    if not path.exists():
        return []
    lines = read_foreign(path, most_mib=64).split(b"\n")[:-1]
    found = []
    for number, line in enumerate(lines, start=1):
        try:
            found.append(parse_json(line, EpisodeLine))
        except msgspec.DecodeError as error:
            raise RecordingError(
                f"{path}: line {number} is no episode: {error}", "restore the file from a copy"
            ) from error
    return found


class EpisodeJournal:
    """The episodes of a session's folder, open to be added to; one program at a time.

    Args:
        folder: The session's.

    Attributes:
        lines: All so far.

    Raises:
        RecordingError: The journal holds something else, or is a link.
        DeviceUnavailableError: Another program takes episodes there.
    """

    def __init__(self, folder: SessionFolder) -> None:
        self.folder = folder
        folder.begin()
        path = folder.path / EPISODES
        self.lines = read_episodes(folder.path)
        self._file: IO[bytes] = open_to_append(path)
        try:
            _lock(self._file, path)
            self._file.seek(0)
            self._file.truncate(self._file.read().rfind(b"\n") + 1)
            self._close_cut()
        except BaseException:
            self._file.close()
            raise

    def _close_cut(self) -> None:
        """Note an episode that the program did not live to end; its recording was finished before."""
        if self.lines and (last := self.lines[-1]).step == "begun":
            self.add(
                "cut" if self.folder.finished(last.file) else "discarded",
                last.file,
                last.task,
                why="the program had stopped",
            )

    @property
    def n_episodes(self) -> int:
        """How many have begun."""
        return sum(line.step == "begun" for line in self.lines)

    def add(
        self,
        step: EpisodeStep,
        file: str,
        task: str,
        *,
        duration_s: float | None = None,
        why: str = "",
    ) -> EpisodeLine:
        """Add a line; when this returns it is on the disk. A discarded episode's recording is deleted first."""
        if step == "discarded":
            self.folder.discard(file)
        elif step != "begun":
            self.folder.label(task, [file])
        number = self.n_episodes + (step == "begun")
        line = EpisodeLine(number, step, round(time.time(), 3), file, task, duration_s, why)
        self._file.write(msgspec.json.encode(line) + b"\n")
        self._file.flush()
        os.fsync(self._file.fileno())
        self.lines.append(line)
        return line

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *_error: object) -> None:
        """Close the file."""
        self._file.close()


def _lock(file: IO[bytes], path: Path) -> None:
    if not lock_file(file, path):
        raise DeviceUnavailableError(f"{path}: another program takes episodes here", "end that one first")
