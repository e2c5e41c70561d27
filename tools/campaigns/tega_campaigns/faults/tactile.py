"""The DIGIT's driver on an emulated sensor with a bad cable."""

from __future__ import annotations

import time
from functools import partial
from typing import Any, Final

import msgspec

from tega.devices.fingertip.digit import Digit, DigitOptions
from tega.errors import DeviceUnavailableError
from tega_campaigns.faults.trials import DriverOutcome, FaultTrial
from tega_campaigns.runner import until
from tega_emulators.digit import FAULTS
from tega_emulators.process import Emulator

__all__ = ["CANNOT", "trials"]

CANNOT: Final[dict[tuple[str, str], str]] = {}

_WATCH_S = 3.0
_QUIET_S = 0.25
_OFF_S = 3.0
_NAMES = {
    "garbage": "garbage",
    "freeze": "freeze",
    "half packet": "torn",
    "duplicate": "duplicate",
}
_WORDS = {
    "torn": "torn",
    "duplicate": "repeated",
    "black": "black",
}


def trials() -> list[FaultTrial]:
    """Return the trials."""
    tried = [FaultTrial("digit", name, FAULTS[fault], partial(_met, fault)) for name, fault in _NAMES.items()]
    # The true rate is looked at every two seconds.
    tried.append(FaultTrial("digit", "slow", FAULTS["slow"], partial(_met, "slow", away_s=5.0)))
    tried.append(
        FaultTrial("digit", "unplug", "breaks the connection, and every new one", partial(_met, "cut"))
    )
    tried.append(
        FaultTrial("digit", "power cycle", f"is away for {_OFF_S:g} s", partial(_met, "cut", away_s=_OFF_S))
    )
    tried.append(FaultTrial("digit", "wrong version", "gives pictures of another size", _refused))
    return tried + [
        FaultTrial("digit", fault, FAULTS[fault], partial(_met, fault))
        for fault in ("black", "strip", "other")
    ]


def _driver(sensor: Emulator) -> Digit:
    make: Any = DigitOptions
    return Digit(make(source=sensor.address["source"], warm_up_s=0.1))


def _refused() -> DriverOutcome:
    with Emulator("digit") as sensor:
        sensor.say("small")
        start_s = time.monotonic()
        try:
            _driver(sensor).open()
        except DeviceUnavailableError as error:
            return DriverOutcome(effect="refused", said=error.message, seen_s=time.monotonic() - start_s)
    return DriverOutcome(effect="goes on", said="opens, unnoticed")


def _met(fault: str, *, away_s: float = _WATCH_S) -> DriverOutcome:
    with Emulator("digit") as sensor, Emulator("digit", "--look", "1") as beside, _driver(sensor) as digit:
        with _driver(beside) as other:
            theirs, own = other.read(5.0), digit.read(5.0)
        if own is not None and theirs is not None:
            digit.compare_with(own.image, {"index": theirs.image})
        before = msgspec.structs.asdict(digit.counts)
        sensor.say(fault)
        begin_s = last_s = time.monotonic()
        while (now_s := time.monotonic()) - begin_s < away_s:
            if digit.read(0.05) is not None:
                last_s = now_s
        counts = {name: n - before[name] for name, n in msgspec.structs.asdict(digit.counts).items()}
        silent = now_s - last_s > _QUIET_S
        notes = digit.info.notes
        sensor.say("clear")
        back_s = until(lambda: digit.read(0.01) is not None, 15.0)
    reported = [f"{words} pictures are withheld" for name, words in _WORDS.items() if counts[name] > 1]
    if counts["lost"]:
        reported.append(
            "no picture comes; the camera is looked for again after 0.25 s, then at most every 4 s"
        )
    reported += notes
    if not silent:
        return DriverOutcome(effect="goes on", said="; ".join(reported) or "nothing is lost")
    return DriverOutcome(
        effect="falls silent", said="; ".join(reported), seen_s=max(0.0, last_s - begin_s), back_s=back_s
    )
