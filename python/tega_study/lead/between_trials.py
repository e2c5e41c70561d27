"""Show how the last trial went, and take corrections and notes on it while nothing runs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tega_study.beep_score import beep_sentence
from tega_study.journal import Journal, counting
from tega_study.lead.trial import EXPERIMENTER, undo_last
from tega_study.state import REPEATABLE

if TYPE_CHECKING:
    from tega.runtime.clock import Clock
    from tega_study.lead.experimenter import Desk


GIVE_UP = "k"
"""Key that gives up a trial that was broken off, or that was to be done again."""


class TrialBefore:
    """Corrections and notes of the trial that ended last.

    Args:
        journal: The session's events.
        desk: The experimenter's screen and keys.
        clock: The session's.

    Attributes:
        following: Number and attempt of the trial that comes next; ``None`` after the last.
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
        """Return when that trial ended, by the session's clock; ``None`` before the first trial.

        Args:
            now_ns: The time now, which it is where that cannot be known.
        """
        ended = (event for event in reversed(self._journal.events) if event.kind == "trial_end")
        ended_ns = next((event.t_ns for event in ended if event.status != "skipped"), None)
        if ended_ns is None:
            return None
        # After a restart of the machine its clock begins anew: nobody knows how long ago the end was.
        renewed = any(event.t_ns > now_ns for event in self._journal.events[-1:])
        return now_ns if renewed else min(ended_ns, now_ns)

    @property
    def keys(self) -> list[tuple[str, str]]:
        """Keys that :meth:`take` accepts now, with their descriptions."""
        keys = [("n", "note")]
        if self._repeated is not None:
            keys.append((GIVE_UP, f"give up trial {self._repeated[0]}"))
        if self.which is not None:
            keys = [
                ("y", "it was a success"),
                ("f", "it was a failure"),
                ("u", "undo"),
                ("r", "do it again"),
                *keys,
            ]
        return keys

    @property
    def _repeated(self) -> tuple[int, int] | None:
        """The trial that comes next, if that is a repetition."""
        return None if self.following is None or self.following[1] == 1 else self.following

    def take(self, key: str) -> None:
        """Take in a correction, or a note."""
        if key == "n":
            self.note(self._desk.line("note:"), source=EXPERIMENTER)
            return
        if key == GIVE_UP and self._repeated is not None:
            self._give_up(*self._repeated)
        if self.which is None:
            return
        trial, attempt = self.which
        now_ns = self._clock.now_ns()
        if key in {"y", "f"}:
            self._journal.add(
                "override", t_ns=now_ns, trial=trial, attempt=attempt, success=key == "y", source=EXPERIMENTER
            )
        elif key == "r":
            self._again(trial, attempt)
        elif key == "u" and (done := undo_last(self._journal, trial, attempt, t_ns=now_ns)) is not None:
            subject = self._journal.events[(done.undone or 1) - 1]
            self._desk.say(f"undone: {subject.kind} of trial {trial}")

    def _again(self, trial: int, attempt: int) -> None:
        """Have the trial done once more; the reason is kept, and the attempt that took place does not count."""
        events = counting(self._journal.events, trial, attempt)
        ended = next((event.status for event in events if event.kind == "trial_end"), None)
        twice = any(
            e.kind == "redo" for n in range(1, attempt + 1) for e in counting(self._journal.events, trial, n)
        )
        if ended not in REPEATABLE or twice:
            self._desk.say(f"trial {trial} cannot be done again: {'twice is the most' if twice else ended}")
            return
        if why := self._desk.line(f"why trial {trial} is done again (empty: it is not):").strip():
            self._journal.add(
                "redo",
                t_ns=self._clock.now_ns(),
                trial=trial,
                attempt=attempt,
                source=EXPERIMENTER,
                text=why,
            )
            self._desk.say(f"trial {trial} comes again at the end of its block; this attempt does not count")

    def _give_up(self, trial: int, attempt: int) -> None:
        """Give up a trial that was broken off: it is not repeated, and has no data."""
        if why := self._desk.line(f"why trial {trial} is given up (empty: it is not):").strip():
            self._journal.add(
                "trial_end",
                t_ns=self._clock.now_ns(),
                trial=trial,
                attempt=attempt,
                status="skipped",
                success=False,
                source=EXPERIMENTER,
                text=why,
            )
            self._desk.say(f"trial {trial} is given up and has no data")

    def note(self, text: str, *, source: str = "auto") -> None:
        """Write a note; before the first trial it belongs to none."""
        trial, attempt = self.which or (0, 1)
        self._journal.add(
            "note", t_ns=self._clock.now_ns(), trial=trial, attempt=attempt, source=source, text=text
        )

    def lines(self) -> list[str]:
        """Return how that trial went, to be shown."""
        if self.which is None:
            return []
        trial, attempt = self.which
        events = counting(self._journal.events, trial, attempt)
        end = next((event for event in events if event.kind == "trial_end"), None)
        if end is None or end.status is None:
            return []
        if end.status not in REPEATABLE:
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
