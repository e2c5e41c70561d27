"""Score a running session in a terminal, also over SSH: the observer's console. Needs the extra ``observe``."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import ClassVar

from rich.markup import escape
from textual import events
from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal
from textual.widgets import Digits, Input, Static

from tega_study.journal import CODES, SEEN
from tega_study.observe.observing import Now, Observing

_POLL_S = 0.1
_REPEAT_NS = 80_000_000
_KEYS = {CODES[kind]: kind for kind in SEEN if kind in CODES}
_NAMES: dict[str, str] = {kind: kind.replace("_", "-") for kind in CODES}
_SCORED = [(key, _NAMES[kind]) for kind, key in CODES.items()]
_HELP = "   ".join(
    f"[b]{key}[/] {subject}" for key, subject in (*_SCORED, ("u", "undo"), ("n", "note"), ("q q", "quit"))
)
_QUIT = "q once more to quit; your scores are on the disk"


class Console(App[None]):
    """Shows a session to a rater and takes the rater's keys; raises as :class:`Observing` does."""

    ENABLE_COMMAND_PALETTE = False
    AUTO_FOCUS = None  # else the line for notes would take the keys
    CSS = """
    Screen { align: center top; padding: 0 2; }
    #where { text-style: bold; width: 100%; text-align: center; padding: 1 0 0 0; }
    #clock { width: 100%; text-align: center; padding: 1 0; }
    #phase { width: 100%; text-align: center; text-style: bold; }
    #counts { height: 3; align: center middle; padding: 1 0 0 0; }
    #counts Static { width: 1fr; text-align: center; }
    #list { height: 6; width: 100%; border: round $primary; padding: 0 1; margin: 1 0; }
    #health { width: 100%; text-align: center; }
    #said { width: 100%; text-align: center; color: $warning; height: 1; }
    #keys { dock: bottom; width: 100%; text-align: center; background: $panel; }
    #note { dock: bottom; display: none; }
    """
    # Its own keys would end it, or hide what is going on, by one wrong press.
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("ctrl+q", "refuse", show=False, priority=True),
        Binding("tab", "refuse", show=False, priority=True),
    ]

    def __init__(self, folder: Path, participant: str, rater: str) -> None:
        super().__init__()
        self._participant, self._rater = participant, rater
        self._pressed: tuple[str, int] = ("", 0)
        self._note_ns = 0
        self._quitting = False
        self._texts: dict[str, str] = {}
        self.said = ""
        self.observing = Observing(folder, participant, rater, t_ns=time.monotonic_ns())

    def compose(self) -> ComposeResult:
        """Lay out the console."""
        yield Static(id="where")
        yield Digits("--:--.-", id="clock")
        yield Static(id="phase")
        with Horizontal(id="counts"):
            for kind in _KEYS.values():
                yield Static(id=kind)
        yield Static(id="list")
        yield Static(id="health")
        yield Static(id="said", markup=False)
        yield Input(placeholder="note, then Enter", id="note")
        yield Static(_HELP, id="keys")

    def on_mount(self) -> None:
        """Begin to look."""
        self.set_interval(_POLL_S, self._check_if_present)
        self.check()

    def on_unmount(self) -> None:
        """Close the rater's file."""
        self.observing.close()

    def action_refuse(self) -> None:
        """Do nothing but say so."""
        self.say("q q quits")

    def on_key(self, event: events.Key) -> None:
        """Take a key, at the moment at which it was pressed."""
        if self.query_one("#note", Input).display:
            if event.key == "escape":
                self._end_note()
            return
        t_ns = _pressed_ns(event)
        again = event.key == self._pressed[0] and t_ns - self._pressed[1] < _REPEAT_NS
        self._pressed = event.key, t_ns
        if again:  # a key that is held repeats itself
            return
        key = event.character or ""
        quitting, self._quitting = self._quitting, False
        self.say("")
        if key in _KEYS:
            self._refused(self.observing.press(_KEYS[key], t_ns))
        elif key == "u":
            self._refused(self.observing.undo(t_ns))
        elif key == "n":
            self._note_ns = t_ns
            note = self.query_one("#note", Input)
            note.display = True
            note.focus()
        elif key == "q":
            if quitting:
                self.exit()
            self._quitting = True
            self.say(_QUIT)
        elif key:
            self._refused(f"{key!r} means nothing")
        event.stop()
        event.prevent_default()
        self._check_if_present()

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Keep a note."""
        if event.value.strip():
            self.observing.note(event.value.strip(), self._note_ns)
        self._end_note()

    def _end_note(self) -> None:
        note = self.query_one("#note", Input)
        note.value = ""
        note.display = False
        self.set_focus(None)

    def _check_if_present(self) -> None:
        if self.query("#where"):  # else it is being taken down
            self.check()

    def check(self) -> None:
        """Show how the session stands."""
        t_ns = time.monotonic_ns()
        now = self.observing.check(t_ns)
        trial = now.running[0] if now.running is not None else now.following
        where = f"{self._participant} · rater {self._rater}"
        if now.board is not None:
            where += f" · {now.board.n_over} of {now.board.n_trials} trials over"
        self._put("where", where)
        self._put("clock", _clock(now, t_ns))
        self._put("phase", _phase(now) + (f" · {trial.object}" if trial is not None else ""))
        kinds = [event.kind for event in now.events]
        for kind in _KEYS.values():
            self._put(kind, f"{_NAMES[kind]}  [b]{kinds.count(kind)}[/]")
        self._put("list", _listed(now))
        health = () if now.board is None or not now.led else now.board.health
        self._put("health", "\n".join(f"[b red]! {escape(one)}[/]" for one in health) or _fine(now))

    def _refused(self, why: str) -> None:
        """Say why a key was refused, where it was."""
        if why:
            self.bell()
            self.say(why)

    def say(self, text: str) -> None:
        """Show a line until the next key."""
        self.said = text
        self.query_one("#said", Static).update(text)

    def _put(self, name: str, text: str) -> None:
        """Show markup in one of the places; what stands there already is not sent to the terminal again."""
        if self._texts.get(name) != text:
            self._texts[name] = text
            if name == "clock":
                self.query_one("#clock", Digits).update(text)
            else:
                self.query_one(f"#{name}", Static).update(text)


def _pressed_ns(event: events.Key) -> int:
    """Return when a key was pressed, on the machine's clock: as it was read, however late it is handled."""
    clock = time.perf_counter if sys.platform == "win32" else time.monotonic
    return time.monotonic_ns() - round(max(clock() - event.time, 0.0) * 1e9)


def _clock(now: Now, t_ns: int) -> str:
    """Return the trial's time, or the remaining rest."""
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
        return "the session is not running now"
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
        lines.append(at + _NAMES.get(event.kind, event.kind))
    return "\n".join(lines)


def _fine(now: Now) -> str:
    if now.led:
        return "[green]devices: nothing is wrong[/]" if now.running is not None else ""
    return "[yellow]study run is not there; keys are still kept[/]" if now.running is not None else ""
