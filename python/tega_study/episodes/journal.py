"""Keep a journal of episodes beside their recordings: one JSON object a line, appended and synced one by one."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Literal

import msgspec

from tega.recording.mcap_folder import SessionFolder
from tega.runtime.files.whole_file import JsonLines, read_json_lines

EPISODES = "episodes.jsonl"

EpisodeStep = Literal["begun", "kept", "discarded", "cut"]


class EpisodeLine(msgspec.Struct, frozen=True, omit_defaults=True, forbid_unknown_fields=True):
    """One line of ``episodes.jsonl``.

    Attributes:
        episode: Its number in the folder, from 1; one that was discarded keeps its own.
        step: ``cut`` where the program ended before the episode did, and what there is was kept.
        at_s: Since 1970.
        file: The recording; a discarded one's name goes to a later episode.
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
    """Read a folder's journal; a last line that was cut off is passed over, a missing file holds none."""
    return read_json_lines(folder / EPISODES, EpisodeLine, "episode")


class EpisodeJournal(JsonLines[EpisodeLine]):
    """The episodes of a session's folder, open to be added to; one program at a time.

    Raises ``RecordingError`` if the journal holds something else or is a link.
    """

    def __init__(self, folder: SessionFolder) -> None:
        self.folder = folder
        folder.begin()
        path = folder.path / EPISODES
        taken = f"{path}: another program takes episodes here", "end that one first"
        super().__init__(path, EpisodeLine, "episode", taken=taken)
        if self.entries and (last := self.entries[-1]).step == "begun":
            # The program did not live to end it; its recording was finished before.
            try:
                step: EpisodeStep = "cut" if folder.finished(last.file) else "discarded"
                self.add(step, last.file, last.task, why="the program had stopped")
            except BaseException:
                self.close()
                raise

    @property
    def n_episodes(self) -> int:
        """How many have begun."""
        return sum(line.step == "begun" for line in self.entries)

    def add(
        self, step: EpisodeStep, file: str, task: str, *, duration_s: float | None = None, why: str = ""
    ) -> EpisodeLine:
        """Add a line; when this returns it is on the disk. A discarded episode's recording is deleted first."""
        if step == "discarded":
            self.folder.discard(file)
        elif step != "begun":
            self.folder.label(task, [file])
        number = self.n_episodes + (step == "begun")
        line = EpisodeLine(number, step, round(time.time(), 3), file, task, duration_s, why)
        return self.append(line)
