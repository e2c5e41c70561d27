"""Derive from a session's events how each trial stands and which comes next. No other state is kept."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import msgspec

from tega.errors import InvalidValueError, RecordingError
from tega_study.journal import WITH_DATA, Journal, JournalEvent, Status, events_path, undone_numbers
from tega_study.plan import PlannedTrial, StudyPlan
from tega_study.study_notes import check_stays

Where = Literal["lab", "emulated", "simulated"]
"""Kind of a session's devices."""

TrialStatus = Literal["planned", "running", "redo"] | Status


class SessionState(msgspec.Struct, frozen=True):
    """State of a session's trials; ``status`` and ``attempts`` (how often each was begun) are by number.

    ``running`` and ``next`` (``None`` when all are over) are number and attempt of a trial: the one that is going
    on, or was when everything stopped, and the one to do next. ``n_over`` trials need nothing more.
    """

    status: dict[int, TrialStatus]
    running: tuple[int, int] | None
    next: tuple[int, int] | None
    n_over: int
    attempts: dict[int, int]

    @property
    def without_data(self) -> dict[int, str]:
        """Trials that are over and have no data, with the reason."""
        why = {"aborted_safety": "stopped for safety", "skipped": "given up"}
        return {number: why[status] for number, status in self.status.items() if status in why}

    @property
    def broken_off(self) -> list[int]:
        """Trials that were begun, have no data yet and will be repeated."""
        return [number for number, status in self.status.items() if status == "aborted_technical"]

    def said(self) -> str:
        """Return in words which trials have no data; ``""`` if all that are over have some."""
        parts = []
        if lost := self.without_data:
            named = ", ".join(f"{number} ({why})" for number, why in lost.items())
            parts.append(f"{len(lost)} of {len(self.status)} trials without data: {named}")
        if self.broken_off:
            parts.append(f"broken off and to be repeated: {', '.join(map(str, self.broken_off))}")
        return "; ".join(parts)


def derive(trials: Sequence[PlannedTrial], events: Sequence[JournalEvent]) -> SessionState:
    """Work out how a session stands; ``RecordingError`` if the events don't fit the plan or one another.

    A trial that was broken off for technical reasons is repeated after the others of its block until it has
    data, is stopped for safety, or is given up (``skipped``). One that the experimenter wants again
    (``redo``) is repeated, too.
    """
    status: dict[int, TrialStatus] = {trial.trial: "planned" for trial in trials}
    attempts = dict.fromkeys(status, 0)
    running: tuple[int, int] | None = None
    began_ns = 0
    undone, redone = undone_numbers(events), set[int]()

    def damaged(what: str, hint: str = "restore the file from a copy") -> RecordingError:
        return RecordingError(f"event {event.n}: trial {event.trial} {what}", hint)

    for event in events:
        if event.kind not in {"trial_start", "trial_end", "redo"} or event.n in undone:
            continue
        if event.trial not in status:
            raise damaged("is not in the plan", "restore the plan")
        if event.kind == "redo":
            again = event.trial in redone or event.attempt != attempts[event.trial]
            if status[event.trial] not in WITH_DATA or again:
                raise damaged("cannot be done again")
            status[event.trial] = "redo"
            redone.add(event.trial)
        elif event.kind == "trial_start":
            if running is not None or event.attempt != attempts[event.trial] + 1:
                raise damaged("begins out of turn")
            attempts[event.trial], status[event.trial] = event.attempt, "running"
            running, began_ns = (event.trial, event.attempt), event.t_ns
        else:
            skipped = running is None and event.status == "skipped" and _open(status[event.trial])
            if event.status is None or not (skipped or running == (event.trial, event.attempt)):
                raise damaged("ends that had not begun")
            # One without data may have been closed after the machine, and with it the clock, was started again.
            if event.status in WITH_DATA and event.t_ns < began_ns:
                raise damaged("ends before it began")
            status[event.trial], running = event.status, None
    n_over = sum(not _open(one) for one in status.values())
    return SessionState(status, running, _next(trials, status, attempts), n_over, attempts)


def _open(status: TrialStatus) -> bool:
    """Return whether a trial is still to be done."""
    return status in {"planned", "aborted_technical", "running", "redo"}


def _next(
    trials: Sequence[PlannedTrial], status: dict[int, TrialStatus], attempts: dict[int, int]
) -> tuple[int, int] | None:
    for block in dict.fromkeys(trial.block for trial in trials):
        mine = [trial.trial for trial in trials if trial.block == block]
        left = [number for number in mine if _open(status[number])]
        if left:  # those that were broken off come last
            number = min(left, key=lambda one: status[one] != "planned")
            return number, attempts[number] + 1
    return None


def resume(
    folder: Path, plan: StudyPlan, participant: str, *, t_ns: int, where: Where = "lab"
) -> tuple[Journal, SessionState]:
    """Open a person's session, new or after a stop at any moment, and work out how it stands.

    A trial that was going on when everything stopped is closed as broken off for technical reasons. The
    journal is the one to go on with. Raises ``InvalidValueError`` if the plan is not for sessions that run
    there, ``RecordingError`` if the events belong to another plan or the person has withdrawn,
    ``DeviceUnavailableError`` if another program has the session open.
    """
    trials = plan.of(participant)
    check_stays(folder, participant)
    if where != "lab" and not plan.settings.simulated:
        raise InvalidValueError(
            f"{where} sessions do not belong into a plan of people: they would pass for data",
            "rehearse in a plan of its own: tega-teleop study plan --simulated --out REHEARSAL ...",
        )
    if where == "lab" and plan.settings.simulated:
        raise InvalidValueError(
            "this plan is for simulated and emulated sessions: people in it would pass for simulated",
            "make a plan without --simulated",
        )
    journal = Journal(events_path(folder, participant))
    try:
        signed = plan.settings.plan_sha256
        _same_plan(journal.events, signed, participant)
        state = derive(trials, journal.events)
        if state.running is not None:
            number, attempt = state.running
            why = "the program had stopped"
            own: dict[str, Any] = {"trial": number, "attempt": attempt, "source": "auto", "text": why}
            journal.add("trial_end", t_ns=t_ns, status="aborted_technical", **own)
        journal.add("session_start", t_ns=t_ns, source="auto", text=signed, item=where)
        return journal, derive(trials, journal.events)
    except BaseException:
        journal.close()
        raise


def rehearsed(events: Sequence[JournalEvent]) -> bool:
    """Return whether a session, or a part of it, did not run in the lab."""
    return any(event.kind == "session_start" and event.item in {"simulated", "emulated"} for event in events)


def _same_plan(events: Sequence[JournalEvent], signed: str, participant: str) -> None:
    if any(event.kind == "session_start" and event.text != signed for event in events):
        raise RecordingError(
            f"{participant}: the session belongs to another plan", "open it in the folder it came from"
        )
