"""A pulse is shown for its time, and the same event not again until a gap after it."""

from __future__ import annotations

import pytest

from tega.haptics.motor_layout import find_layout
from tega.records import Contact, Event
from tega.stages.base import VestSetup
from tega.stages.pulses import PulsesMapping, PulsesOptions

MS = 1_000_000
TOUCHED = {"index": Contact(finger="index", t_ns=0, in_contact=True)}


@pytest.mark.parametrize(("second_ms", "n"), [(100, 1), (490, 1), (500, 2), (900, 2)])
def test_an_event_is_shown_again_after_pulse_and_gap(second_ms: int, n: int) -> None:
    setup = VestSetup(find_layout("x40"), ("index",), {"index": {}})
    mapping = PulsesMapping(setup, PulsesOptions(duration_s=0.2, gap_s=0.3))
    lit = 0
    for t_ms in range(0, 1200, 10):
        events = [Event(t_ns=t_ms * MS, kind="contact", finger="index")] if t_ms in {0, second_ms} else []
        lit += mapping.levels(t_ms * MS, TOUCHED, events).max() > 0
    assert mapping.n_told["contact"] == n
    assert lit == 20 * n
