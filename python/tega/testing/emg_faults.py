"""What each live EMG driver makes of each fault: ``python -m tega.testing.emg_faults`` prints the table of the docs.

Every cell is one run against the emulator: what happened, and how long after the fault was switched on.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

from tega.devices.chords import Chords, ChordsOptions
from tega.devices.cyton import Cyton, CytonOptions
from tega.devices.live_emg import LiveEmg
from tega.devices.lsl_emg import LslEmg, LslEmgOptions
from tega.devices.serial_emg import SerialEmg, SerialEmgOptions
from tega.errors import DeviceUnavailableError, SampleRateError
from tega.testing.emulators.process import Emulator

__all__ = ["FAULT_ROWS", "main", "outcome"]

# A fault that has not ended the source by then is one that it lives with.
_WATCH_S = 6.0
_READ_S = 0.1

FAULT_ROWS = {
    "unplug": "unplug",
    "freeze": "freeze",
    "garbage": "garbage",
    "half packets (one in ten)": "half 0.1",
    "loss (one in ten)": "loss 0.1",
    "noise (one packet in twenty)": "noise 0.05",
    "duplicates (one in five)": "duplicate 0.2",
    "slow (a third of the speed)": "slow 0.33",
    "restart under an open port": "reset",
}
"""What the fault is called, and what the emulator is told."""


class _Driver(NamedTuple):
    emulator: str
    make: Callable[[str], LiveEmg]
    knows: tuple[str, ...]


_NETWORK = ("unplug", "freeze", "loss 0.1", "duplicate 0.2", "slow 0.33")
_DRIVERS = {
    "serial-emg": _Driver(
        "ascii_board",
        lambda port: SerialEmg(SerialEmgOptions(port=port, rate_hz=500.0, bits=10)),
        tuple(FAULT_ROWS.values()),
    ),
    "cyton": _Driver("cyton", lambda port: Cyton(CytonOptions(port=port)), tuple(FAULT_ROWS.values())),
    "chords": _Driver("chords", lambda port: Chords(ChordsOptions(port=port)), tuple(FAULT_ROWS.values())),
    "lsl-emg": _Driver("lsl", lambda port: LslEmg(LslEmgOptions(by="source_id", value=port)), _NETWORK),
}


def outcome(driver: str, fault: str) -> str:
    """Run a driver into a fault and say what came of it.

    Args:
        driver: Its name, such as ``cyton``.
        fault: What its emulator is told, such as ``loss 0.1``.

    Returns:
        How it ended and after how many seconds, or what was counted while it went on; ``"-"`` where the
        emulator does not have that fault.
    """
    case = _DRIVERS[driver]
    if fault not in case.knows:
        return "-"
    with Emulator(case.emulator, "--signal", "emg") as device, case.make(device.port) as source:
        source.read(1.0)
        device.say(fault)
        n, start_s = 0, time.monotonic()
        while (passed_s := time.monotonic() - start_s) < _WATCH_S:
            try:
                chunk = source.read(_READ_S)
            except SampleRateError:
                return f"refused: rate, after {passed_s:.1f} s"
            except DeviceUnavailableError as error:
                how = "silent" if "valid sample" in error.message else "lost"
                return f"ends: {how}, after {time.monotonic() - start_s:.1f} s"
            n += 0 if chunk is None else len(chunk.samples)
        health = source.health
        n_missing = 0 if health is None else health.missing_samples
        counted = [f"{100 * n_missing / (n + n_missing):.0f} % missing"] if n_missing else []
        told = ("no packet", "twice", "row of", "came where")
        counted += [n.partition(", the last")[0] for n in source.info.notes if any(t in n for t in told)]
        return "goes on" + (f": {'; '.join(counted)}" if counted else ", unnoticed")


def main() -> None:
    """Print the table, in Markdown."""
    print(f"| fault | {' | '.join(_DRIVERS)} |")  # noqa: T201  # a program
    print("|---" * (len(_DRIVERS) + 1) + "|")  # noqa: T201
    for name, fault in FAULT_ROWS.items():
        print(f"| {name} | {' | '.join(outcome(d, fault) for d in _DRIVERS)} |", flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
