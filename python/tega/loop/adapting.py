"""Let a run adapt its EMG channels: track the conditions for it, the announced target and the undo key."""

from __future__ import annotations

from typing import Final

from tega.config import SessionConfig
from tega.loop.emg_adaptation import ChannelAdaptation, Switches
from tega.loop.inbox.prepared import Muscles
from tega.records import Button, Contact, HeardMarker, RunState
from tega.records.bus import Bus

UNDO_SEAT: Final = "undo"
_TARGET = "target:"
_MAY_CHANGE = frozenset({"armed", "active"})


class AdaptationWatch:
    """Derives the switches of the adaptation from the records on the bus; thread-safe.

    Other programs announce a target with a marker, ``target:0.8``, and end it with ``target:``.
    """

    def __init__(self, bus: Bus) -> None:
        self._state, self._target, self._n_undone = "", None, 0
        self._touching: dict[str, bool] = {}
        bus.subscribe(RunState, self._changed, name="adaptation")
        bus.subscribe(Contact, self._felt, name="adaptation")
        bus.subscribe(HeardMarker, self._received, name="adaptation")
        bus.subscribe(Button, self._pressed, name="adaptation")

    _target: float | None

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

    def _pressed(self, button: Button) -> None:
        if button.seat == UNDO_SEAT and button.pressed:
            self._n_undone += 1


def open_adaptation(config: SessionConfig, muscles: Muscles, bus: Bus) -> ChannelAdaptation | None:
    """Make the adaptation of a run's muscles; ``None`` where the settings do not ask for it.

    The bus has the records that allow adaptation; every change is published on it.
    """
    settings = config.stages.adaptation
    if not settings.on or muscles.decoder is None:
        return None
    watch = AdaptationWatch(bus)
    return ChannelAdaptation(muscles.maxima, settings, switches=watch.switches, notify=bus.publish)
