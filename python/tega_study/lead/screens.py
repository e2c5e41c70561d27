"""Compose what the experimenter sees: screens, and how the last trial went, with corrections and notes on it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tega.runtime.clock import Clock
from tega_study.journal import WITH_DATA, Journal, JournalEvent, Kind, counting
from tega_study.lead.benches import TrialBench
from tega_study.lead.experimenter import Desk, Screen, keys_of
from tega_study.lead.rest_tasks import RunningTask
from tega_study.lead.trial import EXPERIMENTER, LedTrial, undo_last
from tega_study.side_scores import beep_sentence


def waiting(
    heading: str, thing: str, left_s: float, before: Sequence[str], keys: Sequence[tuple[str, str]]
) -> Screen:
    """Return the screen of a rest, and of being asked to begin once it is over (``left_s`` of 0).

    ``thing`` is what will be lifted, ``""`` after the last trial; ``before`` how the trial before went,
    ``keys`` what can be noted about it.
    """
    stop = ("q q", "stop here")
    if left_s > 0:
        minutes, seconds = divmod(int(left_s + 0.999), 60)
        return Screen("rest", heading, f"rest  {minutes}:{seconds:02d}", before, [stop, *keys])
    if not thing:
        return Screen("ready", heading, "Enter to end the session", before, [("Enter", "end"), *keys])
    big = f"put the {thing} in its place; Enter to begin"
    return Screen("ready", heading, big, before, [("Enter", "begin"), stop, *keys])


def doing(heading: str, running: RunningTask) -> Screen:
    """Return the screen of a task in a rest."""
    left = "" if running.left_s is None else f"  {running.left_s:.0f} s"
    return Screen("task", heading, running.prompt + left, [running.task.words], [("a", "end it")])


def running(heading: str, led: LedTrial, window_s: float, *, bench: TrialBench) -> Screen:
    """Return the screen of a trial from the moment its devices start."""
    going = led.going
    big = {
        "preparing": going.reason or "devices start",
        "countdown": f"ready … {max(1, round(led.left_s + 0.5))}",
    }.get(led.phase, f"{going.elapsed_s():5.1f} s of {window_s:g}")
    lines, rule, events = [], led.rule, led.events()
    if led.phase == "trial":
        how = "on the table" if led.lift_off_s is None else "off the table"
        if rule.lifted:
            how = "lifted and held"
        elif rule.since_s is not None:
            how = "at the mark"
        slips, deformations, drops = (
            sum(event.kind == kind for event in events) for kind in ("slip", "deformation", "drop")
        )
        lines.append(f"{how}   slips {slips}   deformations {deformations}   drops {drops}")
    if going.state == "hold":
        lines.append(f"hold: {going.reason}")
    keys = [("a", "break off")]
    if led.phase == "trial":
        keys = keys_of(sees_height=bench.sees_height, measures_height=bench.measures_height)
    if led.phase == "trial" and led.beeps is not None:
        keys.append((led.beeps.key, "participant noticed a beep"))
    return Screen(led.phase, heading, big, lines, keys, going.alerts)


def ended(led: LedTrial, end: JournalEvent) -> list[str]:
    """Return the messages for an ended trial."""
    status = "" if end.status == "done" else f" ({end.status})"
    parts = [f"trial {led.trial.trial}: {end.text}{status}{beep_sentence(led.events(), end.t_ns)}"]
    if led.lift_off_s is None and any(event.kind == "slip" for event in led.events()):
        parts.append("No lift-off was marked, so the slips of this trial count as before lift-off.")
    return parts


GIVE_UP = "k"
"""Key that gives up a trial that was broken off, or that was to be done again."""


class TrialBefore:
    """Corrections and notes of the trial that ended last.

    ``following`` is number and attempt of the trial that comes next; ``None`` after the last.
    """

    def __init__(self, journal: Journal, desk: Desk, clock: Clock) -> None:
        self._journal, self._desk, self._clock = journal, desk, clock
        self.following: tuple[int, int] | None = None

    @property
    def which(self) -> tuple[int, int] | None:
        """Trial and attempt that ended last; ``None`` before the first."""
        ends = (event for event in reversed(self._journal.events) if event.kind == "trial_end")
        return next(((event.trial, event.attempt) for event in ends), None)

    def ended_ns(self, now_ns: int) -> int | None:
        """Return when that trial ended; ``None`` before the first, the time now where it cannot be known."""
        ended = (event for event in reversed(self._journal.events) if event.kind == "trial_end")
        ended_ns = next((event.t_ns for event in ended if event.status != "skipped"), None)
        if ended_ns is None:
            return None
        # After a restart of the machine its clock begins again: nobody knows how long ago the end was.
        renewed = any(event.t_ns > now_ns for event in self._journal.events[-1:])
        return now_ns if renewed else min(ended_ns, now_ns)

    @property
    def keys(self) -> list[tuple[str, str]]:
        """Keys that :meth:`take` accepts now, with their descriptions."""
        keys = [("n", "note")]
        if self._repeated is not None:
            keys.append((GIVE_UP, f"give up trial {self._repeated[0]}"))
        verdicts = [("y", "it was a success"), ("f", "it was a failure")]
        return keys if self.which is None else [*verdicts, ("u", "undo"), ("r", "do it again"), *keys]

    @property
    def _repeated(self) -> tuple[int, int] | None:
        """The trial that comes next, if that is a repetition."""
        return None if self.following is None or self.following[1] == 1 else self.following

    def take(self, key: str) -> None:
        """Take in a correction, or a note."""
        if key == "n":
            self.note(self._desk.line("note:"), source=EXPERIMENTER)
            return
        over, given_up = self._repeated if key == GIVE_UP else None, {"status": "skipped", "success": False}
        if over is not None and self._explained("trial_end", "given up", over, **given_up):
            self._desk.say(f"trial {over[0]} is given up and has no data")
        if self.which is None:
            return
        trial, attempt = self.which
        if key in {"y", "f"}:
            self.add("override", success=key == "y")
        elif key == "r":
            self._again(trial, attempt)
        elif key == "u":
            done = undo_last(self._journal, trial, attempt, t_ns=self._clock.now_ns())
            if done is not None:
                subject = self._journal.events[(done.undone or 1) - 1]
                self._desk.say(f"undone: {subject.kind} of trial {trial}")

    def _again(self, trial: int, attempt: int) -> None:
        """Have the trial done once more; the reason is kept, and the attempt that took place does not count."""
        events = counting(self._journal.events, trial, attempt)
        ended = next((event.status for event in events if event.kind == "trial_end"), None)
        twice = any(
            e.kind == "redo" for n in range(1, attempt + 1) for e in counting(self._journal.events, trial, n)
        )
        if ended not in WITH_DATA or twice:
            self._desk.say(f"trial {trial} cannot be done again: {'twice is the most' if twice else ended}")
            return
        if self._explained("redo", "done again", (trial, attempt)):
            self._desk.say(f"trial {trial} comes again at the end of its block; this attempt does not count")

    def _explained(self, kind: Kind, what: str, which: tuple[int, int], **fields: Any) -> bool:
        """Ask for a reason, and add the event with it; return whether a reason was given."""
        why = self._desk.line(f"why trial {which[0]} is {what} (empty: it is not):").strip()
        if why:
            self.add(kind, which, text=why, **fields)
        return bool(why)

    def note(self, text: str, *, source: str = "auto") -> None:
        """Write a note; before the first trial it belongs to none."""
        self.add("note", text=text, source=source)

    def add(self, kind: Kind, which: tuple[int, int] | None = None, **fields: Any) -> None:
        """Add an event of the experimenter's, unless ``fields`` name another source, to a trial and attempt."""
        trial, attempt = which or self.which or (0, 1)
        own = {"t_ns": self._clock.now_ns(), "trial": trial, "attempt": attempt, "source": EXPERIMENTER}
        self._journal.add(kind, **{**own, **fields})

    def lines(self) -> list[str]:
        """Return how that trial went, to be shown."""
        if self.which is None:
            return []
        trial, attempt = self.which
        events = counting(self._journal.events, trial, attempt)
        end = next((event for event in events if event.kind == "trial_end"), None)
        if end is None or end.status is None:
            return []
        if end.status not in WITH_DATA:
            how = "given up" if end.status == "skipped" else end.status.replace("_", " ")
            return [f"trial {trial}: {how}, {end.text}"]
        success = bool(end.success)
        for event in events:
            if event.kind == "override" and event.success is not None:
                success = event.success
        n = {kind: sum(event.kind == kind for event in events) for kind in ("slip", "deformation")}
        how = "success" if success else "failure"
        if any(event.kind == "redo" for event in events):
            how = "to be done again"
        return [
            f"trial {trial}: {how}; slips {n['slip']}, deformations {n['deformation']}; {end.text}"
            + beep_sentence(events, end.t_ns)
        ]
