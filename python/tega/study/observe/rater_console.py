"""Define what the raters' consoles share: one key an event, notes, undo, and a layout for terminals."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable
from typing import ClassVar

from textual import events
from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal
from textual.widget import Widget
from textual.widgets import Digits, Input, Static

from tega.study.journal import JournalEvent, Kind

_REPEAT_NS = 80_000_000
_KEYS: dict[str, Kind] = {"l": "lift_off", "s": "slip", "d": "deformation", "x": "drop"}
NAMES: dict[str, str] = {"lift_off": "lift-off", "slip": "slip", "deformation": "deformation", "drop": "drop"}
"""What the kinds of events are called."""

_OWN = (*((key, NAMES[_KEYS[key]]) for key in "sdxl"), ("u", "undo"), ("n", "note"), ("q q", "quit"))
_QUIT = "q once more to quit; what was scored is on the disk"


def help_line(keys: Iterable[tuple[str, str]] = _OWN) -> str:
    """Return keys and what they do as a line of markup; those that every console has where none are given."""
    return "   ".join(f"[b]{key}[/] {what}" for key, what in keys)


def pressed_ns(event: events.Key) -> int:
    """Return when a key was pressed, on the machine's clock: as it was read, however late it is handled."""
    clock = time.perf_counter if sys.platform == "win32" else time.monotonic
    return time.monotonic_ns() - round(max(clock() - event.time, 0.0) * 1e9)


class RaterConsole(App[None]):
    """Takes a rater's keys; what is scored, and what is shown of it, is for who derives from it."""

    ENABLE_COMMAND_PALETTE = False
    AUTO_FOCUS = None  # else the line for notes would take the keys
    LOOK_S: ClassVar[float] = 0.1
    KEYS: ClassVar[str] = help_line()
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

    def __init__(self) -> None:
        super().__init__()
        self._pressed: tuple[str, int] = ("", 0)
        self._note_ns = 0
        self._quitting = False
        self._texts: dict[str, str] = {}
        self.said = ""

    # What is different.

    def take_event(self, kind: Kind, t_ns: int) -> str:
        """Add an event; return why it was refused, else ``""``."""
        raise NotImplementedError

    def take_back(self, t_ns: int) -> str:
        """Undo the newest event; return why it was refused, else ``""``."""
        raise NotImplementedError

    def take_note(self, text: str, t_ns: int) -> None:
        """Keep a note."""
        raise NotImplementedError

    def take_key(self, event: events.Key, t_ns: int) -> bool:  # noqa: ARG002
        """Take another key; tell whether it means anything."""
        return False

    def begin_note(self, t_ns: int) -> None:
        """Get ready for a note that is about to be written."""

    def look(self) -> None:
        """Show how things stand."""
        raise NotImplementedError

    def leave(self) -> None:
        """Close what is open."""
        raise NotImplementedError

    def between(self) -> Iterable[Widget]:
        """Return the widgets between the counts and the list."""
        return ()

    # What is the same.

    def compose(self) -> ComposeResult:
        """Lay out the console."""
        yield Static(id="where")
        yield Digits("--:--.-", id="clock")
        yield Static(id="phase")
        with Horizontal(id="counts"):
            for kind in _KEYS.values():
                yield Static(id=kind)
        yield from self.between()
        yield Static(id="list")
        yield Static(id="health")
        yield Static(id="said", markup=False)
        yield Input(placeholder="note, then Enter", id="note")
        yield Static(self.KEYS, id="keys")

    def on_mount(self) -> None:
        """Begin to look."""
        self.set_interval(self.LOOK_S, self._look_if_there)
        self.look()

    def on_unmount(self) -> None:
        """Close what is open."""
        self.leave()

    def action_refuse(self) -> None:
        """Do nothing but say so."""
        self.say("q q quits")

    def key_ns(self, event: events.Key) -> int:
        """Return when a key was pressed."""
        return pressed_ns(event)

    def on_key(self, event: events.Key) -> None:
        """Take a key, at the moment at which it was pressed."""
        if self.query_one("#note", Input).display:
            if event.key == "escape":
                self._end_note()
            return
        t_ns = self.key_ns(event)
        again = event.key == self._pressed[0] and t_ns - self._pressed[1] < _REPEAT_NS
        self._pressed = event.key, t_ns
        if again:  # a key that is held repeats itself
            return
        key = event.character or ""
        quitting, self._quitting = self._quitting, False
        self.say("")
        if key in _KEYS:
            self.refused(self.take_event(_KEYS[key], t_ns))
        elif key == "u":
            self.refused(self.take_back(t_ns))
        elif key == "n":
            self._note_ns = t_ns
            self.begin_note(t_ns)
            note = self.query_one("#note", Input)
            note.display = True
            note.focus()
        elif key == "q":
            if quitting:
                self.exit()
            self._quitting = True
            self.say(_QUIT)
        elif not self.take_key(event, t_ns) and key:
            self.refused(f"{key!r} means nothing")
        event.stop()
        event.prevent_default()
        self._look_if_there()

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Keep a note."""
        if event.value.strip():
            self.take_note(event.value.strip(), self._note_ns)
        self._end_note()

    def _end_note(self) -> None:
        note = self.query_one("#note", Input)
        note.value = ""
        note.display = False
        self.set_focus(None)

    def _look_if_there(self) -> None:
        if self.query("#where"):  # else it is being taken down
            self.look()

    def refused(self, why: str) -> None:
        """Say why a key was refused, where it was."""
        if why:
            self.bell()
            self.say(why)

    def say(self, text: str) -> None:
        """Show a line until the next key."""
        self.said = text
        self.query_one("#said", Static).update(text)

    def put(self, name: str, text: str) -> None:
        """Show markup in one of the places; what stands there already is not sent to the terminal again."""
        if self._texts.get(name) != text:
            self._texts[name] = text
            self.query_one(f"#{name}", Static).update(text)

    def put_clock(self, text: str) -> None:
        """Show a time in large digits."""
        if self._texts.get("clock") != text:
            self._texts["clock"] = text
            self.query_one("#clock", Digits).update(text)

    def put_counts(self, found: Iterable[JournalEvent]) -> None:
        """Show how many events of each kind there are."""
        kinds = [event.kind for event in found]
        for kind in _KEYS.values():
            self.put(kind, f"{NAMES[kind]}  [b]{kinds.count(kind)}[/]")
