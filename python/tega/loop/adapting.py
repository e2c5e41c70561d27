"""Do what the keys of a run ask for: let its EMG channels adapt, undo that, and take new baselines."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from tega.config import SessionConfig
from tega.loop.emg_adaptation import ChannelAdaptation, Switches
from tega.loop.inbox.inputs import Muscles
from tega.loop.inbox.sources import SourceReport
from tega.records import Button, Contact, HeardMarker, RunState
from tega.records.bus import Bus
from tega.stages.base import Metric

UNDO_SEAT: Final = "undo"
_TARGET = "target:"
_MAY_CHANGE = frozenset({"armed", "active"})


def on_press(bus: Bus, seat: str, action: Callable[[], None], *, name: str, vital: bool = False) -> None:
    """Call an action at every press of a seat's button that is published on a bus."""

    def pressed(button: Button) -> None:
        if button.seat == seat and button.pressed:
            action()

    bus.subscribe(Button, pressed, name=name, vital=vital)


class AdaptationWatch:
    """Derives the switches from records; markers announce a target, ``target:0.8``, and end it, ``target:``."""

    def __init__(self, bus: Bus) -> None:
        self._state, self._n_undone = "", 0
        self._target: float | None = None
        self._touching: dict[str, bool] = {}
        bus.subscribe(RunState, self._changed, name="adaptation")
        bus.subscribe(Contact, self._felt, name="adaptation")
        bus.subscribe(HeardMarker, self._received, name="adaptation")
        on_press(bus, UNDO_SEAT, self._undo, name="adaptation")

    def switches(self, _n_samples: int = 0) -> Switches:
        """Return the switches now."""
        allowed = self._state in _MAY_CHANGE and not any(self._touching.values())
        return Switches(allowed, self._target, self._n_undone)

    def _changed(self, change: RunState) -> None:
        self._state = change.state

    def _felt(self, contact: Contact) -> None:
        self._touching[contact.finger] = contact.in_contact

    def _received(self, marker: HeardMarker) -> None:
        if not marker.text.startswith(_TARGET):
            return
        try:
            target = float(marker.text.removeprefix(_TARGET) or "nan")
        except ValueError:
            return
        self._target = target if 0.0 <= target <= 1.0 else None

    def _undo(self) -> None:
        self._n_undone += 1


def open_adaptation(config: SessionConfig, muscles: Muscles, bus: Bus) -> ChannelAdaptation | None:
    """Make the adaptation of a run's muscles, which publishes its changes; ``None`` if the settings want none."""
    settings = config.stages.adaptation
    if not settings.on or muscles.decoder is None:
        return None
    watch = AdaptationWatch(bus)
    return ChannelAdaptation(muscles.maxima, settings, switches=watch.switches, notify=bus.publish)


REZERO_SEAT: Final = "rezero"
REZERO_KEY: Final = "b"


class FingerRezero:
    """Takes a finger's new baseline before its next picture is measured, for a press of the seat ``rezero``."""

    def __init__(self, bus: Bus, metric: Metric, report: SourceReport) -> None:
        self._metric, self._report = metric, report
        self._n_requests = self._n_answered = 0
        on_press(bus, REZERO_SEAT, self._ask, name="rezero")

    def _ask(self) -> None:
        self._n_requests += 1

    def before_picture(self) -> bool:
        """Return whether a baseline was taken: it was asked for, and no other finger bears a load."""
        if self._n_answered == (n := self._n_requests):
            return False
        self._n_answered = n
        taken = not self._metric.loaded and self._metric.rezero()
        self._report.n_rezeroed += taken
        self._report.n_rezero_refused += not taken
        return taken


class RezeroKey:
    """Publishes the press of a terminal's key as a request for a new baseline."""

    def __init__(self, bus: Bus) -> None:
        self._bus, self._t_ns, self._n = bus, 0, 0
        bus.subscribe(Contact, self._measured, name="rezero key")

    def _measured(self, contact: Contact) -> None:
        self._t_ns = contact.t_ns

    def press(self) -> None:
        """Ask every finger for a new baseline."""
        self._bus.publish(
            Button(seat=REZERO_SEAT, t_ns=self._t_ns, seq=self._n, button=REZERO_KEY, pressed=True)
        )
        self._n += 1
