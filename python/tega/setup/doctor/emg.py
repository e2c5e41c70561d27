"""Check the amplifier: whether it answers, how fast it is for the filter, and how its signal looks."""

from __future__ import annotations

import time
from typing import Any

from tega.devices import driver_class
from tega.devices.base import optional
from tega.errors import SampleRateError, TegaError
from tega.runtime.evidence import Contradiction
from tega.setup.doctor.findings import DriverCase, Finding, failed, holders

_POLL_S = 2.2
"""The spectrum of the mains takes two seconds."""
_TOO_SLOW = (
    "a sketch with delay() or too many characters on a line is the usual reason: print faster, raise the baud rate",
    "set rate_hz in its options to its real rate, if that is enough (125 Hz at least)",
)


def try_amplifier(case: DriverCase) -> list[Finding]:
    """Open an amplifier or recording, read for a moment, close it."""
    source: Any = driver_class(case.driver, "emg")(case.options)
    label = source.info.label
    try:
        with source:
            n_samples = _read(source)
            info = source.info
            measured_hz = optional(source, "measured_hz")
            contradictions: tuple[Contradiction, ...] = optional(source, "contradictions")
            reported = {str(one) for one in contradictions}
            faults = [fault for fault in optional(source, "faults") if fault not in reported]
    except SampleRateError as error:
        return [failed(case, error, device=label, todo=_TOO_SLOW)]
    except TegaError as error:
        port = str(getattr(case.options, "port", ""))
        # A pseudo-terminal is always held by the emulator behind it.
        busy = holders(port) if port.startswith("/dev/") and not port.startswith("/dev/pts/") else []
        why = f"{', '.join(busy)} has {port} open" if busy else ""
        return [failed(case, error, device=label, why=why, status="error" if busy else None)]
    channels = f"{len(info.channels)} channels"
    if not info.live:
        text = f"{case.driver} {label}: a recording, {channels} at {info.rate_hz or 0:g} samples a second"
        return [case.reported(label, "ok", text)]
    rate_hz = measured_hz or info.rate_hz or 0.0
    measured = {"rate_hz": round(rate_hz, 1), "n_samples": float(n_samples)}
    if not n_samples:
        text = f"{case.driver} {label} opened, and then sent nothing for {_POLL_S:g} s"
        return [case.reported(label, "error", text, todo=("check its power and its cable",))]
    text = f"{case.driver} {label} sends {rate_hz:.0f} samples a second, {channels}"
    about = [note for note in info.notes if not any(fault in note for fault in (*faults, *reported))]
    findings = [
        case.reported(
            label,
            "warning",
            f"{case.driver} {label}: {fault}",
            why="without electrodes on a person this is to be expected",
            todo=("put the electrodes on (docs/placement.md), rest, and look again",),
            measured=measured,
        )
        for fault in faults
    ]
    findings += [
        case.reported(
            label,
            "error",
            f"{case.driver} {label}: {one}",
            todo=(one.hint,) if one.hint else (),
            measured=measured,
        )
        for one in contradictions
    ]
    return [case.reported(label, "ok", text, why="; ".join(about), measured=measured), *findings]


def _read(source: Any) -> int:
    """Read for a moment and return how many samples came."""
    if not source.info.live:
        chunk = source.read(0.0)
        return 0 if chunk is None else len(chunk.samples)
    n, until_s = 0, time.monotonic() + _POLL_S
    while (left_s := until_s - time.monotonic()) > 0:
        chunk = source.read(min(left_s, 0.2))
        n += 0 if chunk is None else len(chunk.samples)
    return n
