"""The live EMG drivers on emulated amplifiers."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple

from tega.devices.emg.chords import Chords, ChordsOptions
from tega.devices.emg.cyton import Cyton, CytonOptions
from tega.devices.emg.live_emg import LiveEmg
from tega.devices.emg.lsl_emg import LslEmg, LslEmgOptions
from tega.devices.emg.serial_emg import SerialEmg, SerialEmgOptions
from tega.devices.emg.spiker import Spiker, SpikerOptions
from tega.errors import TegaError
from tega_campaigns.faults.trials import DriverOutcome, FaultTrial
from tega_emulators.process import Emulator

__all__ = ["CANNOT", "trials"]

# A fault that has not ended the source by then is one that it lives with.
_WATCH_S = 6.0
_READ_S = 0.1
_TOLD: Final = ("no packet", "twice", "row of", "came where")


class _Driver(NamedTuple):
    emulator: str
    make: Callable[[str], LiveEmg]
    wrong: tuple[str, ...]
    wrong_words: str


_DRIVERS: Final = {
    "serial-emg": _Driver(
        "ascii_board",
        lambda port: SerialEmg(SerialEmgOptions(port=port, rate_hz=500.0, bits=10)),
        ("--channels", "2"),
        "prints two numbers a line instead of three",
    ),
    "cyton": _Driver(
        "cyton",
        lambda port: Cyton(CytonOptions(port=port)),
        ("--firmware", "v2.0.0"),
        "has firmware 2, which confirms no setting",
    ),
    "chords": _Driver(
        "chords",
        lambda port: Chords(ChordsOptions(port=port)),
        ("--name", "UNKNOWN-BOARD"),
        "gives an unknown name",
    ),
    "spiker": _Driver(
        "spiker",
        lambda port: Spiker(SpikerOptions(port=port)),
        ("--deaf",),
        "takes no command and sends one channel",
    ),
    "lsl-emg": _Driver(
        "lsl",
        lambda port: LslEmg(LslEmgOptions(by="source_id", value=port)),
        ("--rate", "500", "--stated-rate", "250"),
        "states 250 samples/s and sends 500",
    ),
}
_Fault = tuple[str, tuple[str, ...], tuple[str, ...]]
# What the emulator does, what it is told, and what ends it.
_FAULTS: Final[dict[str, _Fault]] = {
    "unplug": ("the port vanishes", ("unplug",), ("plug",)),
    "freeze": ("sends nothing any more", ("freeze",), ("clear",)),
    "garbage": ("every packet is random bytes", ("garbage",), ("clear",)),
    "half packet": ("one packet in ten is cut off", ("half 0.1",), ("clear",)),
    "slow": ("sends at a third of its speed", ("slow 0.33",), ("clear",)),
    "duplicate": ("one packet in ten comes twice", ("duplicate 0.1",), ("clear",)),
    "power cycle": ("restarts under an open port", ("reset",), ()),
    "loss": ("one packet in ten never arrives", ("loss 0.1",), ("clear",)),
    "noise": ("one packet in twenty has a wrong byte or one more", ("noise 0.05",), ("clear",)),
}
_STREAM_FAULTS: Final[dict[str, _Fault]] = {
    **{fault: _FAULTS[fault] for fault in ("freeze", "slow", "duplicate", "loss")},
    "unplug": ("its outlet goes", ("unplug",), ("plug",)),
    "power cycle": ("its outlet goes and a new one comes", ("unplug", "plug"), ()),
}
_NETWORK: Final = "the network's protocol delivers whole, checked messages or none"
CANNOT: Final = {("lsl-emg", "garbage"): _NETWORK, ("lsl-emg", "half packet"): _NETWORK}


def trials() -> list[FaultTrial]:
    """Return the trials."""
    tried = []
    for name, driver in _DRIVERS.items():
        tried.append(FaultTrial(name, "wrong version", driver.wrong_words, partial(_refused, driver)))
        faults = _FAULTS if name != "lsl-emg" else _STREAM_FAULTS
        for fault, (subject, begin, end) in faults.items():
            tried.append(FaultTrial(name, fault, subject, partial(_met, driver, begin, end)))
    return tried


def _refused(driver: _Driver) -> DriverOutcome:
    with Emulator(driver.emulator, "--signal", "emg", *driver.wrong) as device:
        start_s = time.monotonic()
        try:
            with driver.make(device.port):
                return DriverOutcome(effect="goes on", said="opens, unnoticed")
        except TegaError as error:
            text = _words(error, device.port)
            return DriverOutcome(effect="refused", said=text, seen_s=time.monotonic() - start_s)


def _met(driver: _Driver, begin: tuple[str, ...], end: tuple[str, ...]) -> DriverOutcome:
    with Emulator(driver.emulator, "--signal", "emg") as device, driver.make(device.port) as source:
        source.read(1.0)
        port = device.port
        for line in begin:
            device.say(line)
        notes: dict[str, str] = {}
        n, start_s = 0, time.monotonic()
        while (passed_s := time.monotonic() - start_s) < _WATCH_S:
            try:
                chunk = source.read(_READ_S)
            except TegaError as error:
                passed_s = time.monotonic() - start_s
                for line in end:
                    device.say(line)
                text = _words(error, port)
                back_s = _again(driver, device, source)
                return DriverOutcome(effect="ends", said=text, seen_s=passed_s, back_s=back_s)
            n += 0 if chunk is None else len(chunk.samples)
            # A machine that was busy for a moment measures the rate afresh, and has nothing to say meanwhile.
            for note in source.info.notes:
                notes |= {reported: note.partition(", the last")[0] for reported in _TOLD if reported in note}
        health = source.health
        n_missing = 0 if health is None else health.missing_samples
        counted = []
        if n_missing:
            share = 100 * n_missing / (n + n_missing)
            counted = [f"{share:.0f} % of the samples missing: held for 100 ms, then the channel has no vote"]
    counted += notes.values()
    return DriverOutcome(
        effect="goes on", said="; ".join(counted) or "it looks like a stream without a break"
    )


def _words(error: TegaError, port: str) -> str:
    """Return the message without the number of this run's port or stream, which means nothing to a reader."""
    if "/" in port:
        return error.message.replace(f": {Path(port).name} ", ": the board ")
    return error.message.replace(port, port.rpartition("-")[0])


def _again(driver: _Driver, device: Emulator, source: LiveEmg) -> float | None:
    """Open it again, at its new port if it has one, and return how long the first samples took."""
    source.close()
    start_s = time.monotonic()
    for _ in range(3):
        try:
            with driver.make(device.port) as again:
                if again.read(1.0) is not None:
                    return time.monotonic() - start_s
        except TegaError:
            time.sleep(0.2)
    return None
