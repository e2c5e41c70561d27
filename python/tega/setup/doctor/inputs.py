"""Check pedals, switches and other inputs: whether they are there, open, and read as untouched."""

from __future__ import annotations

import time
from typing import Any

from tega.devices import InputReading, InputSource, driver_class
from tega.errors import TegaError
from tega.setup.doctor.case import DriverCase, failed
from tega.setup.doctor.findings import Finding

_POLL_S = 1.0
_STEP_S = 0.02


def try_input(case: DriverCase) -> list[Finding]:
    """Open an input device, read it for a moment, close it. A device that hangs at rest is not detected."""
    source: Any = driver_class(case.driver, "input")(case.options)
    try:
        with source:
            state = _listen(source)
            info = source.info
    except TegaError as error:
        refused = isinstance(error.__cause__, OSError)
        return [failed(case, error, device=source.info.label, status="error" if refused else None)]
    name = f"{case.driver} {info.label}"
    if not state.live:
        why = "; ".join(info.notes)
        text = f"{name} opened, and then had no data"
        return [
            case.reported(
                info.label,
                "error",
                text,
                why=why,
                todo=("let it go, check its cable or battery, look again",),
            )
        ]
    doubts = [case.reported(info.label, "warning", f"{name}: {note}") for note in info.notes]
    if touched := _touched(state):
        why = "harmless if you touch it just now; else it would move or release something by itself"
        text = f"{name} says that it is touched: {touched}"
        return [
            case.reported(info.label, "warning", text, why=why, todo=("let it go and look again",)),
            *doubts,
        ]
    why = "it reports nothing at rest: move it in tega-teleop run, which shows its values"
    return [case.reported(info.label, "ok", f"{name} is open and at rest", why=why), *doubts]


def _listen(source: InputSource) -> InputReading:
    """Return the state of a device after a moment, or when it is lost."""
    until_s = time.monotonic() + _POLL_S
    while (state := source.state()).live and time.monotonic() < until_s:
        time.sleep(_STEP_S)
    return state


def _touched(state: InputReading) -> str:
    """Return the pushed axes or held buttons in words; ``""`` for none."""
    words = [f"{button} is down" for button in sorted(state.held)]
    return ", ".join([*(["the cap is pushed or turned"] if any(state.motion) else []), *words])
