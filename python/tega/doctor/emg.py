"""The amplifier: does it answer, is it fast enough for the filter, what does its signal look like."""

from __future__ import annotations

import time
from typing import Any

from tega.devices import driver_class
from tega.devices.live_emg import LiveEmg
from tega.doctor.case import Case, failed, holders
from tega.doctor.findings import Finding
from tega.errors import SampleRateError, TegaError

__all__ = ["try_amplifier"]

_LOOK_S = 2.2
"""The spectrum of the mains takes two seconds."""
_TOO_SLOW = (
    "a sketch with delay() or too many characters on a line is the usual reason: print faster, raise the baud rate",
    "set rate_hz in its options to what it really sends, if that is enough (125 Hz at least)",
)


def try_amplifier(case: Case) -> list[Finding]:
    """Open an amplifier or recording, read for a moment, close it."""
    source: Any = driver_class(case.driver, "emg")(case.options)
    label = source.info.label
    try:
        with source:
            n_samples = _read(source)
            info = source.info
            measured_hz = source.measured_hz if isinstance(source, LiveEmg) else None
            faults = source.health.now if isinstance(source, LiveEmg) and source.health is not None else ()
    except SampleRateError as error:
        finding = failed(case, error, device=label)
        return [_with_todo(finding, (*finding.todo, *_TOO_SLOW))]
    except TegaError as error:
        port = getattr(case.options, "port", "")
        busy = holders(port) if str(port).startswith("/dev/") else []
        why = f"{', '.join(busy)} has {port} open" if busy else ""
        return [failed(case, error, device=label, why=why, status="wrong" if busy else None)]
    channels = f"{len(info.channels)} channels"
    if not info.live:
        said = f"{case.driver} {label}: a recording, {channels} at {info.rate_hz or 0:g} samples a second"
        return [_fine(case, label, said)]
    rate_hz = measured_hz or info.rate_hz or 0.0
    measured = {"rate_hz": round(rate_hz, 1), "n_samples": float(n_samples)}
    if not n_samples:
        return [
            Finding(
                check=case.check,
                status="wrong",
                finding=f"{case.driver} {label} opened, and then sent nothing for {_LOOK_S:g} s",
                todo=("check its power, its cable, and whether it is still connected",),
                driver=case.driver,
                device=label,
            )
        ]
    said = f"{case.driver} {label} sends {rate_hz:.0f} samples a second, {channels}"
    about = [note for note in info.notes if not any(fault in note for fault in faults)]
    findings = [
        Finding(
            check=case.check,
            status="doubt",
            finding=f"{case.driver} {label}: {fault}",
            why="without electrodes on a person this is to be expected",
            todo=("put the electrodes on (docs/placement.md), rest, and look again",),
            driver=case.driver,
            device=label,
            measured=measured,
        )
        for fault in faults
    ]
    return [_fine(case, label, said, "; ".join(about), measured), *findings]


def _read(source: Any) -> int:
    """Read for a moment and return how many samples came."""
    if not source.info.live:
        chunk = source.read(0.0)
        return 0 if chunk is None else len(chunk.samples)
    n, until_s = 0, time.monotonic() + _LOOK_S
    while (left_s := until_s - time.monotonic()) > 0:
        chunk = source.read(min(left_s, 0.2))
        n += 0 if chunk is None else len(chunk.samples)
    return n


def _fine(
    case: Case, label: str, said: str, why: str = "", measured: dict[str, float] | None = None
) -> Finding:
    return Finding(
        check=case.check,
        status="fine",
        finding=said,
        why=why,
        driver=case.driver,
        device=label,
        measured=measured or {},
    )


def _with_todo(finding: Finding, todo: tuple[str, ...]) -> Finding:
    import msgspec

    return msgspec.structs.replace(finding, todo=tuple(dict.fromkeys(step for step in todo if step)))
