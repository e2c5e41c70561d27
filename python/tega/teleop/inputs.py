"""The operator's input devices in a run: what they say now, and what was pressed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from tega.devices.base import InputEvent, InputSource, InputState

__all__ = ["Inputs", "Seat", "Seen"]

_AXES = ("x", "y", "z", "rx", "ry", "rz")


class Seat(NamedTuple):
    """A device and what of it is meant.

    Attributes:
        source: The open device.
        button: Which of its buttons; ``None`` for any.
    """

    source: InputSource
    button: str | None


class Seen(NamedTuple):
    """What an input device says.

    Attributes:
        state: Its newest state.
        held: Whether the button that is meant is down.
        n_presses: How often it has gone down since the start.
    """

    state: InputState
    held: bool
    n_presses: int

    def words(self, seat: str) -> str:
        """Say it in a few words: the six axes of ``motion``, whether a switch is held, or that there is no data."""
        if not self.state.live:
            return "no data"
        if seat == "motion":
            return "  ".join(f"{axis} {v:+.2f}" for axis, v in zip(_AXES, self.state.motion, strict=True))
        presses = "1 press" if self.n_presses == 1 else f"{self.n_presses} presses"
        return ("held" if self.held else "released") + (f", {presses}" if self.n_presses else "")


class Inputs:
    """Looks at all of them; no look ever waits for a device.

    Args:
        seats: The devices, by what they are for.

    Attributes:
        seen: What each said at the last look.
        observers: Told of every event of a button that is meant, and what the device is for.
    """

    def __init__(self, seats: Mapping[str, Seat]) -> None:
        self._seats = dict(seats)
        self._no_data_looks = dict.fromkeys(seats, 0)
        self._n_looks = 0
        self.seen: dict[str, Seen] = {}
        self.observers: list[Callable[[str, InputEvent], None]] = []

    def look(self) -> dict[str, list[InputEvent]]:
        """Look at every device.

        Returns:
            The events of the buttons that are meant since the last look, by what the device is for.
        """
        events = {}
        self._n_looks += 1
        seen = {}
        for name, (source, button) in self._seats.items():
            state = source.state()
            events[name] = [e for e in source.events() if button in {None, e.button}]
            for event in events[name]:
                for observer in self.observers:
                    observer(name, event)
            before = self.seen[name].n_presses if name in self.seen else 0
            held = bool(state.held) if button is None else button in state.held
            seen[name] = Seen(state, held, before + sum(e.pressed for e in events[name]))
            self._no_data_looks[name] += not state.live
        self.seen = seen
        return events

    def summary(self) -> dict[str, Any]:
        """Return what a run says of them: driver, device, presses, share of the looks that found no data."""
        return {
            name: {
                "driver": seat.source.info.driver,
                "source": seat.source.info.label,
                "presses": self.seen[name].n_presses if name in self.seen else 0,
                "no_data_share": self._no_data_looks[name] / max(self._n_looks, 1),
            }
            for name, seat in self._seats.items()
        }

    def notes(self) -> list[str]:
        """Return what a reader of the results must know."""
        return [f"{name}: {note}" for name, seat in self._seats.items() for note in seat.source.info.notes]
