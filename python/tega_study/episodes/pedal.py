"""Listen to the pedal at ``input.marker`` for episodes: through the run that has it open, and between runs."""

from __future__ import annotations

import time
from collections import deque
from contextlib import suppress
from typing import Any, Final

from tega.config.sections import InputConfig
from tega.devices.registry import driver_class
from tega.errors import InvalidValueError, TegaError
from tega.records import Button
from tega.records.bus import Bus

_SEAT: Final = "marker"
_QUIET_S: Final = 0.5
"""So long after a screen has come up a press is still that of the screen before: a pedal may repeat it."""
_MOST: Final = 64


class EpisodePedal:
    """Presses of the marker seat's device, opened here or by a run; without a seat there are none.

    ``problems`` has why the pedal cannot be read between episodes, if it cannot.
    """

    def __init__(self, seat: InputConfig | None) -> None:
        self._seat = seat
        self._source: Any = None
        self._since_s = 0.0
        self._pressed: deque[str] = deque(maxlen=_MOST)
        self.problems: tuple[str, ...] = ()

    def types(self, key: str) -> bool:
        """Return whether a terminal key is also reported by the pedal, because the pedal is a keyboard."""
        seat = self._seat
        if seat is None or self.problems or getattr(seat.options, "report", "") != "keyboard":
            return False
        return seat.button in {None, key}

    def watch(self, bus: Bus) -> None:
        """Subscribe to the pedal's presses during a run, which opens the device itself."""
        bus.subscribe(Button, self._button, name="episode")

    def _button(self, button: Button) -> None:
        if button.seat == _SEAT and button.pressed:
            self._pressed.append(button.button)

    def listen(self) -> None:
        """Open the device if it is closed, and report presses from half a second from now on."""
        self._since_s = time.monotonic() + _QUIET_S
        self._pressed.clear()
        if self._seat is None or self._source is not None:
            return
        try:
            source: Any = driver_class(self._seat.driver, "input")(self._seat.options)
            source.open()
        except TegaError as error:  # keys do as well
            self.problems = (error.message,)
        else:
            self._source, self.problems = source, ()

    def close(self) -> None:
        """Close it, for a run to open it."""
        source, self._source = self._source, None
        self._pressed.clear()
        self.problems = ()
        if source is not None:
            source.close()

    def presses(self) -> list[str]:
        """Return the buttons pressed since the last call."""
        found: list[str] = []
        if self._source is not None and self._seat is not None:
            with suppress(TegaError):
                pressed = [event.button for event in self._source.events() if event.pressed]
                if time.monotonic() >= self._since_s:
                    found = [button for button in pressed if self._seat.button in {None, button}]
        while self._pressed:
            found.append(self._pressed.popleft())
        return found


def pedal_names(pedals: str, seat: InputConfig | None, taken: frozenset[str]) -> tuple[str, ...]:
    """Return what pedals are called: the keys that they type, or the marker's buttons with commas between.

    One to three different ones, none in ``taken`` (keys that mean something); buttons need a ``seat``.
    """
    names = tuple(name.strip() for name in pedals.split(",")) if "," in pedals else tuple(pedals)
    if len(set(names)) != len(names) or len(names) > 3 or set(names) & (taken | {""}):
        raise InvalidValueError(
            f"pedals {pedals!r}: they are not one to three keys or buttons that mean nothing else",
            "name the keys of a foot switch for continue, discard and repeat, such as bnm, or the buttons of "
            "input.marker, such as left,right",
        )
    if seat is None and (longer := [name for name in names if len(name) > 1]):
        raise InvalidValueError(
            f"pedals {pedals!r}: {longer[0]!r} is no key",
            "set input.marker to the device that has this button",
        )
    if seat is not None and seat.button in names and len(names) > 1:
        raise InvalidValueError(
            f"pedals {pedals!r}: input.marker.button = {seat.button!r} lets no other button through",
            "leave input.marker.button out",
        )
    return names
