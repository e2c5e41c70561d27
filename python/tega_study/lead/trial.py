"""Lead one trial: preparation, countdown, clock, keys, events of the bench, and the end."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

import msgspec

from tega.errors import TegaError
from tega.runtime.clock import Clock
from tega.runtime.files.whole_file import write_whole
from tega.stages.events.outcomes import LIFT_M, OFF_TABLE_M, LiftRule, StableReading, success
from tega_study.attempt_rows import HAND, TOUCH, recording_folder, write_hand, write_touch
from tega_study.coupling import TouchCourse, write_course
from tega_study.journal import WITH_DATA, Journal, JournalEvent, Kind, Status, counting
from tega_study.lead.benches import TrialBench
from tega_study.lead.experimenter import END
from tega_study.lead.running_trial import ARM, Going, in_thread
from tega_study.masking_sound import Beeps
from tega_study.plan import PlannedTrial
from tega_study.side_scores import trial_medians
from tega_study.trials import course_path

EXPERIMENTER = "experimenter"
PARTICIPANT = "participant"
COUNTDOWN_S = 3.0
PLACE_S = 15.0
"""Task ``place``: time after the window in which the object is put down, seconds."""

Task = Literal["lift", "place"]
"""Ends a trial. Enter begins one and answers questions: one Enter too many must not end the trial that it began."""

QUIET_S = 1.0
"""Seconds after a trial's start without result keys: too short for a lift or a drop."""

_OWN = {"slip", "deformation", "drop", "override", "note", "redo"}
_KEYS: dict[str, Kind] = {"s": "slip", "d": "deformation"}


class _TrialEnd(NamedTuple):
    t_s: float
    status: Status
    why: str = ""


@dataclass
class LedTrial:
    """A trial from the moment the bench starts to make ready; :meth:`step` is called until it is over.

    ``task``: ``lift`` is over when the object has been held up, ``place`` when it has been put down as well.
    The object has to be lifted within ``window_s``. ``beeps`` is the second task.

    Attributes:
        phase: ``preparing``, ``countdown`` (``left_s`` remain), ``trial`` or ``over``.
        broke: What made it end before it had begun; ``""`` otherwise.
    """

    folder: Path
    trial: PlannedTrial
    attempt: int
    bench: TrialBench
    journal: Journal
    clock: Clock
    task: Task
    window_s: float
    stable: StableReading = "begun"
    time_scale: float = 1.0
    beeps: Beeps | None = None

    def __post_init__(self) -> None:
        """Have the bench make ready, in a thread."""
        bench = self.bench
        self._since_ns: int | None = None
        self._observed, self._keyed = (LiftRule(window_s=self.window_s, stable=self.stable) for _ in range(2))
        self._keyed_height = not (bench.sees_height or bench.measures_height)
        self.going = Going(
            self.clock,
            feel=bench.felt(self.trial.condition),
            own_time=bench.own_time,
            closure=bench.closure,
            measure_lift=bench.measures_height,
        )
        self.phase, self.left_s, self.broke = "preparing", 0.0, ""
        self._kept: set[tuple[Kind, str]] = set()
        self._where = recording_folder(self.folder, self.trial, self.attempt)
        self._thread, self._raised = in_thread(lambda: bench.run(self.trial, self.going, self._where))

    @property
    def rule(self) -> LiftRule:
        """The rule that counts: from the keys if the height was keyed, else from observation."""
        return self._keyed if self._keyed_height else self._observed

    @property
    def lift_off_s(self) -> float | None:
        """When the object left the table, as keyed, else as observed; ``None`` before."""
        return self._observed.lift_off_s if self._keyed.lift_off_s is None else self._keyed.lift_off_s

    def step(self, keys: list[str]) -> bool:
        """Process keys and the bench's observations, write the events that follow into the journal.

        Returns whether the trial is over; its end is then on the disk, unless it had not begun.
        """
        going = self.going
        if going.started_ns is None:
            return self._before(keys)
        if self.phase != "trial":
            self._begin(going.started_ns)
        gone = not self._thread.is_alive()
        end = self._press(keys)
        seen_end = self._check()
        t_s = going.elapsed_s()
        self._keyed.check(t_s)
        if self.beeps is not None:
            self.beeps.check(t_s, self._note_beep)
        self._note_lift()
        end = seen_end or end or self._ended(t_s, gone=gone)
        if end is not None:
            self._finish(end)
        return self.phase == "over"

    def break_off(self, why: str) -> None:
        """End the trial now for technical reasons, such as Ctrl-C."""
        t_s = self.going.elapsed_s()
        self._stop_bench()  # before anything is written: the disk may be full
        if self.going.started_ns is None:
            self.phase, self.broke = "over", why
        elif self.phase != "over":
            if self.phase != "trial":
                self._begin(self.going.started_ns)
            self._finish(_TrialEnd(t_s, "aborted_technical", why))

    def _before(self, keys: list[str]) -> bool:
        going = self.going
        if not self._thread.is_alive() and going.started_ns is None:
            self._stop_bench()
            error = self._raised[0] if self._raised else None
            self.phase = "over"
            self.broke = _reported(error) if error else "the bench ended before the trial began"
            if error is not None and not isinstance(error, TegaError | OSError):
                raise error
            return True
        if "a" in keys or "z" in keys:
            self.break_off("broken off before it began")
            return True
        now_ns = self.clock.now_ns()
        if going.state != "armed":
            self.phase, self._since_ns = "preparing", None
        else:
            self._since_ns = now_ns if self._since_ns is None else self._since_ns
            left_ns = self._since_ns + round(COUNTDOWN_S * self.time_scale * 1e9) - now_ns
            self.phase, self.left_s = "countdown", max(left_ns, 0) / 1e9
            if left_ns <= 0:
                going.go()
        return False

    def _begin(self, started_ns: int) -> None:
        self.phase = "trial"
        if self.beeps is not None:
            self.beeps.begin()
        self._add("trial_start", 0.0, "auto")
        self._where.mkdir(parents=True, exist_ok=True)
        facts = {
            "format": "tega-study-trial",
            "trial": self.trial.id,
            "attempt": self.attempt,
            "zero_ns": self.going.zero_ns,
            "started_ns": started_ns,
        }
        write_whole(
            self._where / "trial.json", msgspec.json.format(msgspec.json.encode(facts), indent=1) + b"\n"
        )

    def _press(self, keys: list[str]) -> _TrialEnd | None:
        t_s = self.going.elapsed_s()
        for key in keys:
            if self.beeps is not None and key == self.beeps.key:
                self._add("answer", t_s, PARTICIPANT)
            elif key in _KEYS:
                self._add(_KEYS[key], t_s, EXPERIMENTER)
            elif key == "x" and t_s >= QUIET_S:
                self._add("drop", t_s, EXPERIMENTER)
                return _TrialEnd(t_s, "failed_task", "dropped")
            elif key == "u":
                undo_last(self.journal, self.trial.trial, self.attempt, t_ns=self.clock.now_ns())
            elif key == " ":
                self._mark(t_s)
            elif key == END and t_s >= QUIET_S:
                return _TrialEnd(t_s, "done", "ended by the experimenter")
            elif key == "a":
                return _TrialEnd(t_s, "aborted_technical", "broken off by the experimenter")
            elif key == "z":
                return _TrialEnd(t_s, "aborted_safety", "stopped by the experimenter")
        return None

    def _mark(self, t_s: float) -> None:
        """Take in a press of space or pedal: off the table, at the height, below it again, and so on."""
        if self.bench.sees_height:
            return
        up = self._keyed.lift_off_s is not None and self._keyed.since_s is None
        self._keyed_height = self._keyed_height or up
        self._keyed.height(t_s, LIFT_M if up else OFF_TABLE_M)

    def _check(self) -> _TrialEnd | None:
        for seen in self.going.seen():
            if seen.kind == "height":
                self._observed.height(seen.t_s, seen.value)
            elif seen.kind == "mark":
                self._mark(seen.t_s)
            elif seen.kind == "drop":
                self._add("drop", seen.t_s, seen.source)
                measured = ", measured by arm and fingertips" if seen.source == ARM else ""
                return _TrialEnd(seen.t_s, "failed_task", f"dropped{measured}")
            elif seen.kind in {"slip", "deformation"}:
                self._add(seen.kind, seen.t_s, "auto")
        return None

    def _note_beep(self, t_ns: int) -> None:
        """Write down a beep; on a bench with a time of its own, when it was asked for."""
        at_ns = self._at(self.going.elapsed_s()) if self.bench.own_time else t_ns
        self.journal.add("beep", t_ns=at_ns, trial=self.trial.trial, attempt=self.attempt, source="auto")

    def _note_lift(self) -> None:
        """Keep lift-off and stable height, as observed and as keyed."""
        observed = ARM if self.bench.measures_height else "auto"
        for rule, source in ((self._observed, observed), (self._keyed, EXPERIMENTER)):
            held_s = rule.held_s[1] if rule.held_s is not None and rule.lifted else None
            found: dict[Kind, float | None] = {"lift_off": rule.lift_off_s, "lifted": held_s}
            for kind, t_s in found.items():
                if t_s is not None and (kind, source) not in self._kept:
                    self._kept.add((kind, source))
                    self._add(kind, t_s, source)

    def _ended(self, t_s: float, *, gone: bool) -> _TrialEnd | None:
        verdict = self.rule.verdict(t_s)
        if self._raised:
            return _TrialEnd(t_s, "aborted_technical", _reported(self._raised[0]))
        if verdict == "lifted" and self.task == "lift" and self.rule.held_s is not None:
            return _TrialEnd(self.rule.held_s[1], "done", "lifted and held")
        if verdict == "too late":
            return _TrialEnd(t_s, "failed_task", "not lifted in time")
        if gone:
            return _TrialEnd(t_s, "done", "the bench has ended")
        if t_s > self.window_s + PLACE_S:
            return _TrialEnd(t_s, "done", "time is over")
        return None

    def _finish(self, end: _TrialEnd) -> None:
        self._stop_bench()
        for seen in self.going.seen():  # what the bench says once it has ended
            if seen.kind in {"slip", "deformation"} and seen.t_s <= end.t_s:
                self._add(seen.kind, seen.t_s, "auto")
        for channel, median_hz in trial_medians(self.going.condition).items():
            self._add("muscles", end.t_s, "auto", item=channel, value=round(median_hz, 2))
        course = self.going.course()
        before = course.t_s <= end.t_s
        write_course(course_path(self.folder, self.trial), TouchCourse(*(one[before] for one in course)))
        write_touch(self._where / TOUCH, [row for row in self.going.touch if row.t_s <= end.t_s])
        write_hand(self._where / HAND, [row for row in self.going.hand if row.t_s <= end.t_s])
        if self._raised and end.status in WITH_DATA:
            end = end._replace(status="aborted_technical", why=_reported(self._raised[0]))
        lifted = success(self.rule, (event.kind for event in self.events()))
        status = "failed_task" if end.status == "done" and not lifted else end.status
        self._add("trial_end", end.t_s, "auto", status=status, success=lifted, text=end.why)
        self.phase = "over"

    def _stop_bench(self) -> None:
        self.going.end()
        self._thread.join()

    def _at(self, t_s: float) -> int:
        return (self.going.started_ns or 0) + round(t_s * 1e9)

    def _add(self, kind: Kind, t_s: float, source: str, **fields: Any) -> None:
        own = {"trial": self.trial.trial, "attempt": self.attempt, "source": source}
        self.journal.add(kind, t_ns=self._at(t_s), **own, **fields)

    def events(self) -> list[JournalEvent]:
        """Return the events of this attempt that still count."""
        return counting(self.journal.events, self.trial.trial, self.attempt)


def undo_last(journal: Journal, trial: int, attempt: int, *, t_ns: int) -> JournalEvent | None:
    """Undo the experimenter's last addition to an attempt, or a measured drop; ``None`` if there is nothing."""
    mine = [
        event
        for event in counting(journal.events, trial, attempt)
        if (event.source == EXPERIMENTER and event.kind in _OWN)
        or (event.source == ARM and event.kind == "drop")
    ]
    if not mine:
        return None
    return journal.add(
        "undo", t_ns=t_ns, trial=trial, attempt=attempt, undone=mine[-1].n, source=EXPERIMENTER
    )


def _reported(error: BaseException) -> str:
    return str(error) or type(error).__name__
