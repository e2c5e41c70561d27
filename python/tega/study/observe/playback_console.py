"""Score recorded trials in a terminal, on a clock that the rater stops, turns back and slows down."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, ClassVar

from textual.widget import Widget
from textual.widgets import Static

from tega.study.observe.rater_console import NAMES, RaterConsole, help_line
from tega.study.observe.scoring import Scoring

if TYPE_CHECKING:
    from textual import events

    from tega.study.journal import JournalEvent, Kind
    from tega.study.observe.play_head import PlayHead
    from tega.study.observe.scoring import Showing
    from tega.view.state import ViewState


_SEEK_NS = 2_000_000_000
_TRACK = 72
_MARKS = {"lift_off": "l", "slip": "s", "deformation": "d", "drop": "x", "note": "n"}
_PLAY_KEYS = (
    ("space", "play, pause"),
    ("← →", "2 s back, on"),
    ("1 2", "speed"),
    ("Enter", "next"),
    ("p", "previous"),
)
_NO_PICTURE = "no picture here: watch the lab's own video beside it"


class PlaybackConsole(RaterConsole):
    """Plays a person's recorded trials to a rater and takes the rater's keys.

    Args:
        scoring: The rater's file and the trials; it is closed when the console ends.
        participant: Whose trials.
        show: Given what is to be seen whenever that changes; ``None`` where there is no picture.
        where: Said on the screen of the picture, such as its address.
        now_ns: The clock that the play position follows, nanoseconds.
        key_ns: When a key was pressed, by that clock; by the machine's where ``None``.
    """

    LOOK_S: ClassVar[float] = 0.04
    KEYS: ClassVar[str] = help_line(_PLAY_KEYS) + "\n" + help_line()
    CSS = (
        RaterConsole.CSS
        + """
    #track { width: 100%; text-align: center; }
    #clock { padding: 0; }
    #list { margin: 0; }
    """
    )

    def __init__(
        self,
        scoring: Scoring,
        participant: str,
        *,
        show: Callable[[ViewState], None] | None = None,
        where: str = "",
        now_ns: Callable[[], int] = time.monotonic_ns,
        key_ns: Callable[[events.Key], int] | None = None,
    ) -> None:
        super().__init__()
        self.scoring = scoring
        self._participant, self._show, self._address = participant, show, where
        self._now_ns, self._key_ns = now_ns, key_ns
        self._shown: tuple[str, int, str] | None = None
        self._asked_to_leave = False

    def key_ns(self, event: events.Key) -> int:
        """Return when a key was pressed."""
        return super().key_ns(event) if self._key_ns is None else self._key_ns(event)

    def take_event(self, kind: Kind, t_ns: int) -> str:
        """Add an event at the play position of the moment; return why it was refused, else ``""``."""
        self._asked_to_leave = False
        return self.scoring.press(kind, self._at(t_ns))

    def take_back(self, t_ns: int) -> str:
        """Undo the newest event; return why it was refused, else ``""``."""
        self._asked_to_leave = False
        return self.scoring.undo(self._at(t_ns))

    def begin_note(self, t_ns: int) -> None:
        """Stand still while a note is written."""
        if self.scoring.now is not None:
            self.scoring.now.head.pause(t_ns)

    def take_note(self, text: str, t_ns: int) -> None:
        """Keep a note."""
        self.scoring.note(text, self._at(t_ns))

    def take_key(self, event: events.Key, t_ns: int) -> bool:
        """Take a key of the player; tell whether it means anything."""
        sure, self._asked_to_leave = self._asked_to_leave, False
        now = self.scoring.now
        if event.key not in {"backspace", "p", "enter"}:
            return now is not None and self._play(event, now.head, t_ns)
        if now is not None:
            now.head.look(t_ns)
        if event.key == "enter":
            why = self.scoring.finish(sure=sure)
            self._asked_to_leave = bool(why)
        else:
            why = self.scoring.go_back()
        if not why and now is not None:
            now.head.pause(t_ns)
        self.refused(why)
        return True

    def _play(self, event: events.Key, head: PlayHead, t_ns: int) -> bool:
        if event.key == "space":
            if not head.toggle(t_ns):
                self.refused("this is its end: ← goes back, Enter goes on")
        elif event.key == "left":
            head.seek(-_SEEK_NS, t_ns)
        elif event.key == "right":
            head.seek(_SEEK_NS, t_ns)
        elif event.character in {"1", "<", ","}:
            head.step_speed(-1, t_ns)
        elif event.character in {"2", ">", "."}:
            head.step_speed(1, t_ns)
        else:
            return False
        return True

    def _at(self, t_ns: int) -> int:
        return 0 if self.scoring.now is None else self.scoring.now.head.at(t_ns)

    def leave(self) -> None:
        """Close the rater's file."""
        self.scoring.close()

    def between(self) -> Iterable[Widget]:
        """Return the track."""
        return (Static(id="track", markup=True),)

    def look(self) -> None:
        """Move the play head on, and show where it is."""
        scoring, now = self.scoring, self.scoring.now
        n_trials = len(scoring.trials)
        self.put(
            "where", f"{self._participant} · rater {scoring.rater} · {scoring.n_scored} of {n_trials} scored"
        )
        self.put("health", self._health())
        found = scoring.events()
        self.put_counts(found)
        if now is None:
            self.put_clock("--:--.-")
            self.put("phase", "ALL RECORDINGS ARE SCORED · q q quits")
            self.put("track", "")
            self.put("list", "")
            return
        at_ns = now.head.look(self._now_ns())
        number = scoring.trials.index(now.trial) + 1
        self.put_clock(_clock(at_ns))
        self.put(
            "phase", f"recording {number} of {n_trials} · {now.trial.object} · {_doing(now.head, at_ns)}"
        )
        self.put("track", self._track(now, at_ns, found))
        self.put("list", self._listed(now, found))
        self._offer(now, at_ns, f"{number} of {n_trials}")

    def _offer(self, now: Showing, at_ns: int, number: str) -> None:
        """Hand on what is to be seen, where that has changed."""
        doing = _doing(now.head, at_ns)
        if self._show is None or (new := (now.trial.id, at_ns, doing)) == self._shown:
            return
        self._shown = new
        self._show(now.reel.at(at_ns, {"recording": number, "object": now.trial.object, "playing": doing}))

    def _track(self, now: Showing, at_ns: int, found: Sequence[JournalEvent]) -> str:
        """Draw the trial as a line: what was added, and below it what was played and where the head is."""
        length_ns, width = now.trial.length_ns, min(_TRACK, max(self.size.width - 8, 10))

        def column(t_ns: int) -> int:
            return min(max(t_ns * width // length_ns, 0), width - 1)

        marks, line = [" "] * width, ["╌"] * width
        for event in found:
            marks[column(event.t_ns - now.trial.start_ns)] = _MARKS[event.kind]
        for place in range(width):
            begin_ns, end_ns = place * length_ns // width, (place + 1) * length_ns // width
            if any(begin <= begin_ns and end_ns <= end for begin, end in now.head.played):
                line[place] = "━"
        here = column(at_ns)
        before, behind = "".join(line[:here]), "".join(line[here + 1 :])
        return f"[b]{''.join(marks)}[/]\n{before}[b $accent]●[/]{behind}"

    def _listed(self, now: Showing, found: Sequence[JournalEvent]) -> str:
        if self.scoring.whole(now.trial):
            state = "scored, seen whole"
        elif self.scoring.ended(now.trial):
            state = "scored, not seen whole: play what is missing, then Enter"
        elif now.head.seen_end:
            state = "seen to its end: Enter goes on"
        else:
            state = "not seen to its end yet"
        lines = [f"{len(found)} scored here; {state}"]
        if now.n_taken_back:
            lines.append(f"begun anew: {now.n_taken_back} events from before the stop are taken back")
        for event in found[-2 if now.n_taken_back else -3 :]:
            at_s = (event.t_ns - now.trial.start_ns) / 1e9
            lines.append(f"{at_s:6.2f} s  {NAMES.get(event.kind, event.kind)}")
        return "\n".join(lines)

    def _health(self) -> str:
        lines = [
            f"[dim]picture: {self._address}[/]" if self._show is not None else f"[yellow]{_NO_PICTURE}[/]"
        ]
        unseen = self.scoring.unseen
        lines += [f"[yellow]left out: {one.id}: {_plain(one.why)}[/]" for one in unseen[:1]]
        if len(unseen) > 1:
            lines.append(f"[yellow]and {len(unseen) - 1} more, listed at the end[/]")
        return "\n".join(lines)


def _clock(at_ns: int) -> str:
    tenths = at_ns // 100_000_000
    return f"{tenths // 600}:{tenths // 10 % 60:02d}.{tenths % 10}"


def _doing(head: PlayHead, at_ns: int) -> str:
    if head.playing:
        return f"▶ {head.speed:g}×"
    if at_ns == head.length_ns:
        return "■ its end"
    return f"‖ paused, {head.speed:g}×"


def _plain(text: str) -> str:
    return text.replace("[", "\\[")
