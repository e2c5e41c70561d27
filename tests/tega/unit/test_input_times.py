"""A press is published at the time at which the device reported it, counted from the session's start."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from tega.devices.base import DeviceInfo, InputEvent, InputReading
from tega.loop.inbox.inputs import Inputs, Seat
from tega.records import Button, Marker
from tega.records.bus import Bus

START_NS, PRESSED_NS = 7_000_000_000, 7_250_000_000


class OneButton:
    """An input device with one button, which was pressed once."""

    info = DeviceInfo(driver="own", kind="input", label="a button", live=True)

    def __init__(self, *, live: bool = True) -> None:
        self._live = live
        self._events = [InputEvent(t_ns=PRESSED_NS, seq=1, button="a", pressed=True)]

    def state(self) -> InputReading:
        return InputReading(PRESSED_NS, live=self._live, motion=(0.0,) * 6, held=frozenset({"a"}))

    def events(self) -> list[InputEvent]:
        events, self._events = self._events, []
        return events


def looked_at(source: Any, bus: Bus, n_checks: int) -> Inputs:
    """Return the inputs after some looks at a marker."""
    pacer: Any = SimpleNamespace(start_ns=START_NS, elapsed_ns=lambda: PRESSED_NS - START_NS + 1_000_000)
    inputs = Inputs({"marker": Seat(source, "a")})
    for _ in range(n_checks):
        inputs.check(bus, pacer)
    return inputs


def test_a_press_has_the_time_at_which_it_was_reported() -> None:
    bus, seen = Bus(), list[Button | Marker]()
    bus.subscribe(Button, seen.append, vital=True)
    bus.subscribe(Marker, seen.append, vital=True)
    inputs = looked_at(OneButton(), bus, 2)
    assert [type(one) for one in seen] == [Button, Marker]
    assert [one.t_ns for one in seen] == [PRESSED_NS - START_NS] * 2
    assert inputs.seen["marker"].n_presses == 1


def test_the_share_without_data_is_of_the_looks() -> None:
    for live, n_checks, share in ((False, 1, 1.0), (False, 4, 1.0), (True, 4, 0.0), (False, 0, 0.0)):
        summary = looked_at(OneButton(live=live), Bus(), n_checks).summary()
        assert summary["marker"]["no_data_share"] == share
