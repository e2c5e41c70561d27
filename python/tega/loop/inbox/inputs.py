"""Define the inputs of a run: sources with baselines and maxima, the operator's devices with their button events."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega import records
from tega.config.calibration import Calibration, EmgMaxima
from tega.devices.base import EmgSource, InputEvent, InputReading, InputSource, TactileSource
from tega.loop.inbox.sources import SourceReport
from tega.loop.inbox.stream import Stream
from tega.loop.pacing import Pacer
from tega.records import Contact, HandLook, Intent
from tega.records.bus import Bus
from tega.stages.base import Decoder

_AXES = ("x", "y", "z", "rx", "ry", "rz")


class Seat(NamedTuple):
    """An input device, and which of its buttons is meant: ``None`` for any."""

    source: InputSource
    button: str | None


class SeatSeen(NamedTuple):
    """State of an input device at a look: whether its button is down, and the presses since the start."""

    state: InputReading
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
    """Looks at all input devices of a run, by seat, never waiting for one; ``seen`` is from the last look."""

    def __init__(self, seats: Mapping[str, Seat]) -> None:
        self.seats = dict(seats)
        self._no_data_polls = dict.fromkeys(seats, 0)
        self._n_polls = 0
        self.seen: dict[str, SeatSeen] = {}
        self._text: dict[str, tuple[Any, ...]] = {}

    def check(self, bus: Bus, pacer: Pacer) -> None:
        """Look at every device."""
        if not self.seats:
            return
        events: dict[str, list[InputEvent]] = {}
        self._n_polls += 1
        seen = {}
        for name, (source, button) in self.seats.items():
            state = source.state()
            events[name] = [e for e in source.events() if button in {None, e.button}]
            before = self.seen[name].n_presses if name in self.seen else 0
            held = bool(state.held) if button is None else button in state.held
            seen[name] = SeatSeen(state, held, before + sum(e.pressed for e in events[name]))
            self._no_data_polls[name] += not state.live
        self.seen = seen
        self._notify(events, bus, pacer)

    def _notify(self, events: Mapping[str, list[InputEvent]], bus: Bus, pacer: Pacer) -> None:
        for seat, seen in self.seen.items():
            state = seen.state
            content = state[1:]  # without the time of the device's latest report
            if self._text.get(seat) != content:
                self._text[seat] = content
                held = tuple(sorted(state.held))
                t_ns = pacer.elapsed_ns()
                bus.publish(
                    records.InputState(seat=seat, t_ns=t_ns, live=state.live, motion=state.motion, held=held)
                )
        for seat, pressed in events.items():
            for event in pressed:
                t_ns = event.t_ns - pacer.start_ns
                bus.publish(
                    records.Button(
                        seat=seat, t_ns=t_ns, seq=event.seq, button=event.button, pressed=event.pressed
                    )
                )
                if seat == "marker" and event.pressed:
                    bus.publish(records.Marker(t_ns=t_ns, text=event.button, source=seat))

    def summary(self) -> dict[str, Any]:
        """Return a run's summary of its inputs: driver, device, presses, share of the looks that found no data."""
        return {
            name: {
                "driver": seat.source.info.driver,
                "source": seat.source.info.label,
                "presses": self.seen[name].n_presses if name in self.seen else 0,
                "no_data_share": self._no_data_polls[name] / max(self._n_polls, 1),
            }
            for name, seat in self.seats.items()
        }

    def notes(self) -> list[str]:
        """Return notes for readers of the results."""
        return [f"{name}: {note}" for name, seat in self.seats.items() for note in seat.source.info.notes]


class Finger(NamedTuple):
    """One fingertip; ``measured`` and ``stream`` are its contacts where they are known, so that no picture is read."""

    source: TactileSource
    baseline: NDArray[np.uint8]
    baseline_origin: str
    report: SourceReport
    measured: list[Contact] | None = None
    stream: Stream[Contact] | None = None


class Muscles(NamedTuple):
    """The EMG side, ready to run; ``decoder`` is ``None`` where intents are made elsewhere, and come in ``stream``."""

    source: EmgSource
    maxima: EmgMaxima
    decoder: Decoder | None
    report: SourceReport
    stream: Stream[Intent] | None = None


class Prepared(NamedTuple):
    """Prepared sources of a run: fingers by name, thumb first, and muscles.

    ``calibration_name`` is the base name of the maxima's file, or their person; ``""`` when from the recording.
    ``poll_hand`` returns at a tick, by the requested level, a reading of hand and arm from another source.
    """

    fingers: Mapping[str, Finger]
    muscles: Muscles | None
    calibration: Calibration
    calibration_name: str
    warnings: tuple[str, ...] = ()
    poll_hand: Callable[[int, float], HandLook | None] | None = None

    @property
    def sources(self) -> list[TactileSource | EmgSource]:
        """All sources, thumb first, EMG last."""
        found: list[TactileSource | EmgSource] = [finger.source for finger in self.fingers.values()]
        return found if self.muscles is None else [*found, self.muscles.source]
