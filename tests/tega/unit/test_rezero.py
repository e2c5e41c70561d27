"""A new baseline on request: taken once, refused while another finger bears a load or without such a baseline."""

from __future__ import annotations

import numpy as np

from tega.config.choose import preset_metric
from tega.loop.inbox.sources import SourceReport
from tega.loop.rezeroing import REZERO_SEAT, FingerRezero, RezeroKey
from tega.records import Button, Contact
from tega.records.bus import Bus
from tega.stages.base import Metric

STILL = np.full((320, 240, 3), 120, np.uint8)


def marked() -> np.ndarray:
    """A gel with a dent that does not go: what a cut or a new camera position leaves."""
    frame = STILL.copy()
    frame[140:180, 100:140, 0] += 40
    frame[140:180, 100:140, 2] -= 40
    return frame


def request(bus: Bus) -> None:
    bus.publish(Button(seat=REZERO_SEAT, t_ns=0, seq=0, button="page", pressed=True))


def seen(metric: Metric, frames: int, from_ns: int = 0) -> Contact:
    for k in range(frames):
        contact = metric.update(marked(), from_ns + k * 16_666_667)
    return contact


def test_a_dent_that_stays_is_no_contact_after_a_request() -> None:
    bus, report, metric = Bus(), SourceReport(), preset_metric("live", STILL)
    rezero = FingerRezero(bus, metric, report)
    assert seen(metric, 30).in_contact
    assert not rezero.before_picture()
    RezeroKey(bus).press()
    assert rezero.before_picture()
    assert not rezero.before_picture()  # once a request
    assert not seen(metric, 30, 10**9).in_contact
    assert (report.n_rezeroed, report.n_rezero_refused) == (1, 0)


def test_a_request_is_refused_while_another_finger_bears_a_load() -> None:
    bus, report, metric = Bus(), SourceReport(), preset_metric("live", STILL)
    rezero = FingerRezero(bus, metric, report)
    seen(metric, 30)
    metric.loaded = True
    request(bus)
    assert not rezero.before_picture()
    assert (report.n_rezeroed, report.n_rezero_refused) == (0, 1)
    assert seen(metric, 5, 10**9).in_contact


def test_a_metric_without_such_a_baseline_refuses() -> None:
    bus, report = Bus(), SourceReport()
    rezero = FingerRezero(bus, preset_metric("paper", STILL), report)
    request(bus)
    assert not rezero.before_picture()
    assert report.n_rezero_refused == 1
