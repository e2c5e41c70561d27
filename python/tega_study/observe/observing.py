"""Add a rater's events to a running session, and note which trials the rater saw from start to end."""

from __future__ import annotations

import re
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, NamedTuple

from tega.errors import InvalidValueError, RecordingError
from tega_study.journal import CODES, Journal, JournalEvent, Kind, counting, events_path, read_events
from tega_study.lead.tell import FRESH_S, SessionBoard, board_path, read_board
from tega_study.observers import PART, RECORDED, WHOLE, observer_path
from tega_study.plan import PlannedTrial, read_plan
from tega_study.study_notes import check_stays

LATE_NS = 1_000_000_000
"""So long after a trial's end an event still belongs to it, and so late a rater may come and have seen it all."""

_RATER = re.compile(r"[A-Za-z0-9][A-Za-z0-9_+-]{0,39}")


def checked_rater(rater: str) -> str:
    """Return a rater's code; ``InvalidValueError`` if it cannot be a file's name."""
    if not _RATER.fullmatch(rater):
        raise InvalidValueError(f"rater {rater!r}: cannot be a file's name", "use a code such as r1")
    return rater


class Now(NamedTuple):
    """State of the session as a rater is shown it.

    Attributes:
        running: The trial that goes on, its attempt, and when it began on the session's clock.
        newest: The trial that goes on or was the last one, and its attempt.
        events: The rater's events of that trial, without undone ones.
    """

    board: SessionBoard | None
    led: bool
    running: tuple[PlannedTrial, int, int] | None
    newest: tuple[PlannedTrial, int] | None
    events: tuple[JournalEvent, ...]
    following: PlannedTrial | None


class Observing(AbstractContextManager["Observing"]):
    """A rater's file, open; ``DeviceUnavailableError`` if it is open in another console.

    Raises ``InvalidValueError`` if ``rater`` cannot be a file's name, or has scored recordings;
    ``RecordingError`` if the file belongs to another plan or the person has withdrawn.
    """

    def __init__(self, folder: Path, participant: str, rater: str, *, t_ns: int) -> None:
        self.rater = checked_rater(rater)
        plan = read_plan(folder)
        self._trials = {trial.trial: trial for trial in plan.of(participant)}
        check_stays(folder, participant)
        self._main, self._board = events_path(folder, participant), board_path(folder, participant)
        self._size, self._events = -1, list[JournalEvent]()
        self.journal = Journal(observer_path(folder, participant, rater))
        signed = plan.settings.plan_sha256
        starts = [event for event in self.journal.events if event.kind == "session_start"]
        if any(event.text != signed for event in starts):
            self.journal.close()
            raise RecordingError(f"{rater}'s file belongs to another plan", "open it in its own folder")
        if any(event.item == RECORDED for event in starts):
            self.journal.close()
            raise InvalidValueError(f"{rater} has scored recordings of this session", "use another code")
        self._came_ns = t_ns
        self.journal.add("session_start", t_ns=t_ns, source=rater, text=signed)

    def check(self, t_ns: int) -> Now:
        """Look at how the session stands; note the trials that have begun and ended."""
        if (size := self._main.stat().st_size if self._main.exists() else 0) != self._size:
            self._size, self._events = size, read_events(self._main)
        starts = [event for event in self._events if event.kind == "trial_start"]
        board = read_board(self._board)
        led = (
            board is not None
            and board.phase not in {"over", "stopped"}
            and abs(t_ns - board.t_ns) / 1e9 < FRESH_S
        )
        following = None if board is None or board.phase == "trial" else self._trials.get(board.trial)
        if not starts:
            return Now(board, led, None, None, (), following)
        start = starts[-1]
        trial, attempt = self._trials[start.trial], start.attempt
        end = self._of(self._events, "trial_end", trial.trial, attempt)
        self._attend(start, end)
        running = None if end is not None else (trial, attempt, start.t_ns)
        mine = counting(self.journal.events, trial.trial, attempt)
        shown = tuple(event for event in mine if event.kind in {*CODES, "note"})
        return Now(board, led, running, (trial, attempt), shown, following)

    def press(self, kind: Kind, t_ns: int) -> str:
        """Add an event, and return why it was refused; ``""`` when it is on the disk."""
        now = self.check(t_ns)
        if now.newest is None:
            return "no trial has begun yet"
        trial, attempt = now.newest
        if now.running is None:
            key = trial.trial, attempt
            begin, end = (self._of(self._events, one, *key) for one in ("trial_start", "trial_end"))
            # Before it, too: the machine's clock begins again with each start.
            if begin and end and not begin.t_ns <= t_ns <= end.t_ns + LATE_NS:
                return "no trial goes on"
        self._add(kind, t_ns, (trial.trial, attempt))
        return ""

    def undo(self, t_ns: int) -> str:
        """Take back the newest event of the trial that goes on or was the last; the reason where there is none."""
        now = self.check(t_ns)
        if now.newest is None or not now.events:
            return "there is nothing to undo"
        trial, attempt = now.newest
        self._add("undo", t_ns, (trial.trial, attempt), undone=now.events[-1].n)
        return ""

    def note(self, text: str, t_ns: int) -> None:
        """Add a note, to the trial that goes on or was the last where there is one."""
        now = self.check(t_ns)
        key = (0, 1) if now.newest is None else (now.newest[0].trial, now.newest[1])
        self._add("note", t_ns, key, text=text)

    def close(self) -> None:
        """Close the file."""
        self.journal.close()

    def __exit__(self, *_error: object) -> None:
        """Close the file."""
        self.close()

    def _attend(self, start: JournalEvent, end: JournalEvent | None) -> None:
        """Note that a trial has begun, or is over, once; and whether all of it was seen."""
        key = start.trial, start.attempt
        mine = self.journal.events
        saw = self._of(mine, "trial_start", *key)
        whole = self._came_ns - start.t_ns < LATE_NS
        if saw is None:
            if end is not None:  # it was over before anybody looked
                return
            saw = self._add("trial_start", start.t_ns, key, text=WHOLE if whole else PART)
        if end is not None and self._of(mine, "trial_end", *key) is None:
            away = any(event.kind == "session_start" for event in mine[saw.n :])
            self._add("trial_end", end.t_ns, key, text=PART if away or saw.text else WHOLE)

    def _add(self, kind: Kind, t_ns: int, key: tuple[int, int], **more: Any) -> JournalEvent:
        trial, attempt = key
        return self.journal.add(kind, t_ns=t_ns, trial=trial, attempt=attempt, source=self.rater, **more)

    @staticmethod
    def _of(events: list[JournalEvent], kind: Kind, trial: int, attempt: int) -> JournalEvent | None:
        found = (e for e in reversed(events) if (e.kind, e.trial, e.attempt) == (kind, trial, attempt))
        return next(found, None)
