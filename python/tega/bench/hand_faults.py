"""What the hand's driver makes of each fault of the emulated hand, and after what time."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import msgspec

from tega.devices.allegro import Allegro, AllegroOptions
from tega.errors import DeviceUnavailableError
from tega.testing.emulators.allegro import FAULTS
from tega.testing.emulators.allegro_process import AllegroProcess

__all__ = ["FaultRow", "try_faults"]

_WATCH_S = 8.0
_NUISANCE_S = 3.0
_NEVER_OFF = frozenset({"silence", "unplug"})


class FaultRow(msgspec.Struct, frozen=True, kw_only=True):
    """One line of the table.

    Attributes:
        fault: Its name.
        what: What the emulated hand does.
        outcome: ``goes on``, or the error's message.
        off_ms: From the fault to zero torque and SERVO OFF at the hand; ``None`` where it keeps on, or cannot hear.
        told_ms: From the fault to the error; ``None`` where there is none.
    """

    fault: str
    what: str
    outcome: str
    off_ms: float | None
    told_ms: float | None


def try_faults() -> Iterator[FaultRow]:
    """Try every fault in turn, with the driver's default limits and the hand asked to close."""
    starts = {
        "wrong-version": ("--hardware", "0x0500"),
        "wrong-side": ("--side", "left"),
        "absent": ("--device-id", "3"),
    }
    for fault, arguments in starts.items():
        yield _refused(fault, arguments)
    more = {"garbage": "noise between the adapter's lines", "unplug": "hand and adapter are gone"}
    for fault, what in {**FAULTS, **more}.items():
        yield _met(fault, what)


def _refused(fault: str, arguments: tuple[str, ...]) -> FaultRow:
    make: Any = AllegroOptions
    with AllegroProcess(*arguments) as hand:
        begin_s, outcome = time.monotonic(), "goes on"
        driver = Allegro(make(**hand.options))
        try:
            driver.open()
        except DeviceUnavailableError as error:
            outcome = error.message
        told_ms = 1e3 * (time.monotonic() - begin_s)
        driver.close()
    return FaultRow(
        fault=fault, what=f"started with {' '.join(arguments)}", outcome=outcome, off_ms=None, told_ms=told_ms
    )


def _met(fault: str, what: str) -> FaultRow:
    make: Any = AllegroOptions
    # A busy machine must not look like a slow hand before the fault.
    with AllegroProcess() as hand, Allegro(make(**hand.options, lowest_rate_hz=200.0)) as driver:
        driver.step(5)
        time.sleep(0.5)
        if fault == "unplug":
            hand.unplug()
        else:
            hand.command(fault)
        begin_s, off_ms, told_ms, outcome = time.monotonic(), None, None, "goes on"
        silences = driver.state().counts.silences
        while (spent_s := time.monotonic() - begin_s) < _WATCH_S:
            if off_ms is None and fault not in _NEVER_OFF:
                state = hand.command()
                if not state["servo_on"] and not any(state["duties"]):
                    off_ms = 1e3 * (time.monotonic() - begin_s)
            try:
                driver.step(5)
            except DeviceUnavailableError as error:
                outcome, told_ms = error.message, 1e3 * (time.monotonic() - begin_s)
                break
            if spent_s > _NUISANCE_S and driver.state().phase == "running":
                back = driver.state().counts.silences - silences
                outcome = "goes on after a silence, its version checked again" if back else "goes on"
                break
            time.sleep(0.001)
        if told_ms is not None and off_ms is None and fault not in _NEVER_OFF:
            time.sleep(0.05)
            state = hand.command()
            if not state["servo_on"] and not any(state["duties"]):
                off_ms = told_ms
    return FaultRow(fault=fault, what=what, outcome=outcome, off_ms=off_ms, told_ms=told_ms)
