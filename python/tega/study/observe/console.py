"""Score a running session in a terminal, also over SSH: the observer's console. Needs the extra ``observe``."""

from __future__ import annotations

import time
from pathlib import Path

from tega.study.journal import Kind
from tega.study.observe.observing import Now, Observing
from tega.study.observe.rater_console import NAMES, RaterConsole


class Console(RaterConsole):
    """Shows a session to a rater and takes the rater's keys.

    Args:
        folder: The study's folder.
        participant: Whose session.
        rater: Who observes.

    Raises:
        TegaError: As :class:`tega.study.observe.Observing`.
    """

    def __init__(self, folder: Path, participant: str, rater: str) -> None:
        super().__init__()
        self._participant, self._rater = participant, rater
        self.observing = Observing(folder, participant, rater, t_ns=time.monotonic_ns())

    def take_event(self, kind: Kind, t_ns: int) -> str:
        """Add an event; return why it was refused, else ``""``."""
        return self.observing.press(kind, t_ns)

    def take_back(self, t_ns: int) -> str:
        """Undo the newest event; return why it was refused, else ``""``."""
        return self.observing.undo(t_ns)

    def take_note(self, text: str, t_ns: int) -> None:
        """Keep a note."""
        self.observing.note(text, t_ns)

    def leave(self) -> None:
        """Close the rater's file."""
        self.observing.close()

    def look(self) -> None:
        """Show how the session stands."""
        t_ns = time.monotonic_ns()
        now = self.observing.look(t_ns)
        trial = now.running[0] if now.running is not None else now.following
        where = f"{self._participant} · rater {self._rater}"
        if now.board is not None:
            where += f" · {now.board.n_over} of {now.board.n_trials} trials over"
        self.put("where", where)
        self.put_clock(_clock(now, t_ns))
        self.put("phase", _phase(now) + (f" · {trial.object}" if trial is not None else ""))
        self.put_counts(now.events)
        self.put("list", _listed(now))
        health = () if now.board is None or not now.led else now.board.health
        self.put("health", "\n".join(f"[b red]! {one}[/]" for one in health) or _fine(now))


def _clock(now: Now, t_ns: int) -> str:
    """Return the trial's time, or what is left of the rest."""
    if now.running is not None:
        tenths = (t_ns - now.running[2]) // 100_000_000
    elif now.board is not None and now.led and now.board.phase == "rest" and now.board.until_ns is not None:
        tenths = max(now.board.until_ns - t_ns, 0) // 100_000_000
    else:
        return "--:--.-"
    return f"{tenths // 600}:{tenths // 10 % 60:02d}.{tenths % 10}"


def _phase(now: Now) -> str:
    if now.running is not None:
        trial, attempt, _start = now.running
        return f"TRIAL {trial.trial}" + (", again" if attempt > 1 else "")
    if now.board is None:
        return "the session has not begun"
    if now.board.phase == "over":
        return "ALL TRIALS ARE OVER"
    if not now.led:
        return "nobody leads the session now"
    number = f", then trial {now.board.trial}" if now.board.trial else ""
    return now.board.phase.upper() + number


def _listed(now: Now) -> str:
    if now.newest is None:
        return "nothing yet"
    trial, _attempt = now.newest
    lines = [f"trial {trial.trial}, {len(now.events)} scored"]
    begin_ns = None if now.running is None else now.running[2]
    for event in now.events[-3:]:
        at = "" if begin_ns is None else f"{(event.t_ns - begin_ns) / 1e9:6.2f} s  "
        lines.append(at + NAMES.get(event.kind, event.kind))
    return "\n".join(lines)


def _fine(now: Now) -> str:
    if now.led:
        return "[green]devices: nothing is wrong[/]" if now.running is not None else ""
    return "[yellow]study run is not there; keys are still kept[/]" if now.running is not None else ""
