"""Keep a session's events on disk: one JSON object a line, appended and synced one by one, never changed.

An event is kept once :meth:`Journal.add` has returned, whatever happens to the program or the machine then. A line that
a crash has cut off was never promised, and goes when the file is opened again.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Annotated, Literal, Self

import msgspec

from tega.errors import DeviceUnavailableError, RecordingError
from tega.runtime.files.foreign_file import check_file, parse_json, read_foreign
from tega.runtime.files.lock import lock_file
from tega.runtime.files.plain_name import plain_name
from tega.runtime.files.whole_file import open_to_append

Kind = Literal[
    "session_start",
    "session_stop",
    "trial_start",
    "trial_end",
    "lift_off",
    "lifted",
    "slip",
    "deformation",
    "drop",
    "placed",
    "note",
    "override",
    "redo",
    "rating",
    "beep",
    "answer",
    "muscles",
    "squeeze",
    "undo",
    "unblind",
    "behaviour",
]

Status = Literal["done", "failed_task", "aborted_technical", "aborted_safety", "skipped"]


class JournalEvent(msgspec.Struct, frozen=True, omit_defaults=True, forbid_unknown_fields=True):
    """One event of a session.

    Attributes:
        n: Its number in the file, from 1 without a gap.
        t_ns: When, on the session's clock, nanoseconds.
        kind: What.
        trial: Trial number; 0 for events outside of trials.
        attempt: Its attempt, from 1.
        status: ``trial_end``: how it ended.
        success: ``trial_end``: as scored by rule. ``override``: as corrected by a person.
        undone: ``undo``: number of the event that does not count.
        source: ``auto``, or a rater's ID.
        text: A note, or the reason of an end, a correction or a repetition (``redo``). Left out of anonymised copies.
        item: ``rating``: the question, such as ``tlx.effort``. ``muscles``: the channel, such as ``ch1``.
            ``behaviour``: its name in the plan.
        value: ``rating``: the answer, 0 to 100; ``None`` where it was passed over. ``muscles``: the channel's median
            frequency in the trial, Hz. ``squeeze``: its amplitude, as a share of the calibrated maximum. Both are left
            out of anonymised copies.
    """

    n: Annotated[int, msgspec.Meta(ge=1)]
    t_ns: int
    kind: Kind
    trial: Annotated[int, msgspec.Meta(ge=0)] = 0
    attempt: Annotated[int, msgspec.Meta(ge=1)] = 1
    status: Status | None = None
    success: bool | None = None
    undone: int | None = None
    source: str = ""
    text: str = ""
    item: str = ""
    value: float | None = None
    duration_s: float | None = None
    modifiers: tuple[str, ...] = ()


def _parse(content: bytes, path: Path) -> tuple[list[JournalEvent], int]:
    """Return the events, and how many bytes of the file they take, a missing last newline not counted."""
    events: list[JournalEvent] = []
    good = 0
    lines = content.split(b"\n")
    for number, line in enumerate(lines, start=1):
        last = number == len(lines)
        if last and not line:
            break
        try:
            event = parse_json(line, JournalEvent)
        except msgspec.DecodeError as error:
            if last:  # no newline behind it: whoever wrote it was stopped there
                break
            raise RecordingError(
                f"{path}: line {number} is no event: {error}", "restore the file from a copy"
            ) from error
        if event.n != number:
            raise RecordingError(
                f"{path}: line {number} holds event {event.n}, so lines were taken out or put in",
                "restore the file from a copy",
            )
        events.append(event)
        good += len(line) + (not last)
    return events, good


def read_events(path: Path) -> list[JournalEvent]:
    """Read a session's events; a last line that was cut off is passed over, a missing file holds none.

    Args:
        path: The file.

    Raises:
        RecordingError: Another line is no event, or lines are missing.
    """
    return _parse(read_foreign(path, most_mib=256), path)[0] if path.exists() else []


def undone_numbers(events: Sequence[JournalEvent]) -> set[int]:
    """Return the numbers of the events that were undone."""
    return {event.undone for event in events if event.kind == "undo" and event.undone is not None}


def counting(events: Sequence[JournalEvent], trial: int, attempt: int) -> list[JournalEvent]:
    """Return an attempt's events without those that were undone."""
    undone = undone_numbers(events)
    return [e for e in events if e.trial == trial and e.attempt == attempt and e.n not in undone]


class Journal:
    """A session's events, open to be added to; one program at a time.

    Args:
        path: The file; it and its folder are made where they are missing.

    Attributes:
        events: All events so far.

    Raises:
        RecordingError: The file holds something else, or is a link.
        DeviceUnavailableError: Another program has it open.
    """

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        new = not path.exists()
        if not new:
            check_file(path, most_mib=256)
        self._path = path
        self._file: IO[bytes] | None = open_to_append(path)
        try:
            _lock(self._file, path)
            self._file.seek(0)
            content = self._file.read()
            self.events, good = _parse(content, path)
            if good < len(content):
                self._file.truncate(good)
            if good and content[good - 1 : good] != b"\n":  # stopped between an event and its newline
                self._put(b"\n")
            if new:
                _sync_folder(path.parent)
        except BaseException:
            self.close()
            raise

    def add(
        self,
        kind: Kind,
        *,
        t_ns: int,
        trial: int = 0,
        attempt: int = 1,
        status: Status | None = None,
        success: bool | None = None,
        undone: int | None = None,
        source: str = "",
        text: str = "",
        item: str = "",
        value: float | None = None,
        duration_s: float | None = None,
        modifiers: tuple[str, ...] = (),
    ) -> JournalEvent:
        """Add an event; when this returns it is on the disk. Arguments as in :class:`JournalEvent`."""
        event = JournalEvent(
            n=len(self.events) + 1,
            t_ns=t_ns,
            kind=kind,
            trial=trial,
            attempt=attempt,
            status=status,
            success=success,
            undone=undone,
            source=source,
            text=text,
            item=item,
            value=value,
            duration_s=duration_s,
            modifiers=modifiers,
        )
        self._put(msgspec.json.encode(event) + b"\n")
        self.events.append(event)
        return event

    def _put(self, content: bytes) -> None:
        if self._file is None:
            raise RecordingError(f"{self._path}: is closed", "open the journal again")
        self._file.write(content)
        self._file.flush()
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close the file; closing twice does nothing."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *_error: object) -> None:
        """Close the file."""
        self.close()


def _lock(file: IO[bytes], path: Path) -> None:
    if not lock_file(file, path):
        raise DeviceUnavailableError(
            f"{path}: another program has this session open", "close the other console first"
        )


def _sync_folder(folder: Path) -> None:
    """Make sure that the file's name is on the disk too, where folders can be synced."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def events_path(folder: Path, participant: str) -> Path:
    """Return where a person's events are."""
    return (
        folder / "sessions" / plain_name(participant, what="participant", source=folder.name) / "events.jsonl"
    )
