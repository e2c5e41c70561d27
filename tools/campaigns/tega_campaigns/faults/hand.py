"""The Allegro Hand's driver on an emulated hand, with the driver's own limits, asked to close."""

from __future__ import annotations

import time
from functools import partial
from typing import Any, Final

from tega.devices.hand.allegro import Allegro
from tega.devices.hand.allegro_options import AllegroOptions
from tega.errors import DeviceUnavailableError
from tega_campaigns.faults.trials import DriverOutcome, FaultTrial
from tega_emulators.allegro import FAULTS
from tega_emulators.process import Emulator

__all__ = ["CANNOT", "trials"]

CANNOT: Final[dict[tuple[str, str], str]] = {}

_WATCH_S = 8.0
_NUISANCE_S = 3.0
_DEAF = frozenset({"silence", "unplug"})
_MORE = {"garbage": "noise between the adapter's lines", "unplug": "hand and adapter are gone"}
_STARTS = {
    "wrong version": ("is version 5.0", ("--hardware", "0x0500")),
    "wrong side": ("is a left hand", ("--side", "left")),
    "absent": ("another hand is on the bus", ("--device-id", "3")),
}
# The table's words for what the emulator calls otherwise.
_NAMES = {"half": "half packet", "power-cycle": "power cycle", "silence": "freeze", "freeze": "angles stuck"}


def trials() -> list[FaultTrial]:
    """Return the trials."""
    refused = [
        FaultTrial("allegro", name, subject, partial(_refused, words))
        for name, (subject, words) in _STARTS.items()
    ]
    met = [
        FaultTrial("allegro", _NAMES.get(fault, fault), subject, partial(_met, fault))
        for fault, subject in {**FAULTS, **_MORE}.items()
    ]
    return refused + met


def _refused(arguments: tuple[str, ...]) -> DriverOutcome:
    make: Any = AllegroOptions
    with Emulator("allegro_port", *arguments) as hand:
        begin_s = time.monotonic()
        driver = Allegro(make(**hand.address))
        try:
            driver.open()
        except DeviceUnavailableError as error:
            return DriverOutcome(effect="refused", said=_words(error), seen_s=time.monotonic() - begin_s)
        driver.close()
    return DriverOutcome(effect="goes on", said="opens, unnoticed")


def _met(fault: str) -> DriverOutcome:
    make: Any = AllegroOptions
    # A busy machine must not look like a slow hand before the fault.
    with Emulator("allegro_port") as hand, Allegro(make(**hand.address, lowest_rate_hz=200.0)) as driver:
        driver.step(5)
        time.sleep(0.5)
        if fault == "unplug":
            hand.kill()
        else:
            hand.say(fault)
        begin_s, off_s, silences = time.monotonic(), None, driver.state().counts.silences
        while (spent_s := time.monotonic() - begin_s) < _WATCH_S:
            if off_s is None and fault not in _DEAF and _is_off(hand):
                off_s = time.monotonic() - begin_s
            try:
                driver.step(5)
            except DeviceUnavailableError as error:
                reported_s, text = time.monotonic() - begin_s, _words(error)
                break
            if spent_s > _NUISANCE_S and driver.state().phase == "running":
                if driver.state().counts.silences == silences:
                    text = "missing frames are bridged, unknown ones are ignored"
                    return DriverOutcome(effect="goes on", said=text)
                text = "motors off; its version is checked again, then it goes to its target"
                return DriverOutcome(effect="falls silent", said=text, seen_s=off_s)
            time.sleep(0.001)
        else:
            return DriverOutcome(effect="goes on", said="no alert, and not over within 8 s")
        if off_s is None and fault not in _DEAF:
            time.sleep(0.05)
            off_s = reported_s if _is_off(hand) else None
    if fault in _DEAF:
        text += "; it receives nothing meanwhile and keeps its last torque: use the switch"
    elif off_s is not None and reported_s - off_s > 0.1:
        text += f" (alert after {reported_s:.1f} s)"
    return DriverOutcome(
        effect="lets go" if off_s is not None else "ends",
        said=text,
        seen_s=reported_s if off_s is None else off_s,
    )


def _is_off(hand: Emulator) -> bool:
    state = hand.say("look")
    return not state["servo_on"] and not any(state["duties"])


def _words(error: DeviceUnavailableError) -> str:
    return error.message.removeprefix("allegro: ")
