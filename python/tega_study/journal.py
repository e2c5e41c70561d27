"""Keep a session's events on disk: one JSON object a line, appended and synced one by one, never changed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import msgspec

from tega.runtime.files.foreign_file import plain_name
from tega.runtime.files.whole_file import JsonLines, read_json_lines

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

CODES: Final[dict[Kind, str]] = {"slip": "s", "deformation": "d", "drop": "x", "lift_off": "l"}
"""Behaviours that raters code in every study, which are kinds of events, and their keys."""

SEEN: Final[tuple[Kind, ...]] = ("lift_off", "slip", "deformation", "drop", "placed")
"""Kinds of events that accounts of a trial are compared by, and that a person may add to a camera's."""

WITH_DATA: Final = ("done", "failed_task")
"""Statuses of an attempt that has data, and that may be repeated."""


class JournalEvent(msgspec.Struct, frozen=True, omit_defaults=True, forbid_unknown_fields=True):
    """One event of a session.

    Attributes:
        n: Its number in the file, from 1 without a gap.
        t_ns: On the session's clock.
        trial: 0 for events outside of trials.
        success: ``trial_end``: as scored by rule. ``override``: as corrected by a person.
        undone: ``undo``: number of the event that does not count.
        source: ``auto``, or a rater's ID.
        text: A note, or the reason of an end, a correction or a repetition (``redo``). Left out of anonymised
            copies.
        item: ``rating``: the question, such as ``tlx.effort``. ``muscles``: the channel, such as ``ch1``.
            ``behaviour``: its name in the plan.
        value: ``rating``: the answer, 0 to 100; ``None`` where it was passed over. ``muscles``: the channel's
            median frequency in the trial, Hz. ``squeeze``: its amplitude, as a share of the calibrated
            maximum. Both are left out of anonymised copies.
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


def read_events(path: Path) -> list[JournalEvent]:
    """Read a session's events; a last line that was cut off is passed over, a missing file holds none.

    Another line that is no event, or missing lines, are a ``RecordingError``.
    """
    return read_json_lines(path, JournalEvent, "event")


def undone_numbers(events: Sequence[JournalEvent]) -> set[int]:
    """Return the numbers of the events that were undone."""
    return {event.undone for event in events if event.kind == "undo" and event.undone is not None}


def attempts(
    events: Sequence[JournalEvent], *, with_data: bool = False
) -> list[tuple[JournalEvent, JournalEvent]]:
    """Return start and end of every attempt that has ended, in the order of the ends."""
    starts = {(e.trial, e.attempt): e for e in events if e.kind == "trial_start"}
    ends = [e for e in events if e.kind == "trial_end" and (e.trial, e.attempt) in starts]
    return [(starts[e.trial, e.attempt], e) for e in ends if not with_data or e.status in WITH_DATA]


def counting(events: Sequence[JournalEvent], trial: int, attempt: int) -> list[JournalEvent]:
    """Return an attempt's events without those that were undone."""
    undone = undone_numbers(events)
    return [e for e in events if e.trial == trial and e.attempt == attempt and e.n not in undone]


class Journal(JsonLines[JournalEvent]):
    """A session's events, open to be added to; one program at a time.

    A second program gets a ``DeviceUnavailableError``; a link or a damaged file is a ``RecordingError``.
    """

    def __init__(self, path: Path) -> None:
        taken = f"{path}: another program has this session open", "close the other console first"
        super().__init__(path, JournalEvent, "event", taken=taken)

    @property
    def events(self) -> list[JournalEvent]:
        """All events so far."""
        return self.entries

    def add(self, kind: Kind, *, t_ns: int, **fields: Any) -> JournalEvent:
        """Add an event; when this returns it is on the disk. Arguments as in :class:`JournalEvent`."""
        return self.append(JournalEvent(n=len(self.entries) + 1, t_ns=t_ns, kind=kind, **fields))

    def add_attempt(
        self,
        ends: tuple[JournalEvent, JournalEvent],
        source: str,
        events: Iterable[Mapping[str, Any]],
        **outcome: Any,
    ) -> None:
        """Add another account of an attempt: its start, its events, its end.

        ``ends`` are the session's own. Each event gets the attempt's trial, attempt and ``source``;
        ``outcome`` has further fields of the end.
        """
        start, end = ends
        common: dict[str, Any] = {"trial": start.trial, "attempt": start.attempt, "source": source}
        self.add("trial_start", t_ns=start.t_ns, **common)
        for event in events:
            self.add(**event, **common)
        self.add("trial_end", t_ns=end.t_ns, **common, **outcome)


@contextmanager
def replaced_journal(path: Path) -> Iterator[Journal]:
    """Open an empty journal that takes the place of a file once it is written whole."""
    beside = path.with_name(f"{path.name}.new")
    beside.unlink(missing_ok=True)
    with Journal(beside) as journal:
        yield journal
    beside.replace(path)


def events_path(folder: Path, participant: str) -> Path:
    """Return where a person's events are."""
    name = plain_name(participant, subject="participant", source=folder.name)
    return folder / "sessions" / name / "events.jsonl"
