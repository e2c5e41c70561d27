"""Have each finger take a new baseline when a key, a page or a pedal asks for it."""

from __future__ import annotations

from typing import Final

from tega.loop.inbox.sources import SourceReport
from tega.records import Button, Contact
from tega.records.bus import Bus
from tega.stages.base import Metric

REZERO_SEAT: Final = "rezero"
REZERO_KEY: Final = "b"


class FingerRezero:
    """Takes a finger's new baseline before its next picture is measured.

    A press of the seat ``rezero`` on the bus is a request. ``loaded`` of ``metric`` has to be set before each
    picture; ``report`` counts baselines that were taken and that were refused.
    """

    def __init__(self, bus: Bus, metric: Metric, report: SourceReport) -> None:
        self._metric, self._report = metric, report
        self._n_requests = self._n_answered = 0
        bus.subscribe(Button, self._pressed, name="rezero")

    def _pressed(self, button: Button) -> None:
        if button.seat == REZERO_SEAT and button.pressed:
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
