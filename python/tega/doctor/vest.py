"""The vest: can it be reached, and what does it say of itself. It is never sent anything but zeros."""

from __future__ import annotations

from typing import Any

from tega.devices import HarmlessDevice, driver_class
from tega.devices.bluetooth_state import bluetooth_trouble
from tega.doctor.case import Case, failed
from tega.doctor.findings import Finding
from tega.errors import MissingExtraError, TegaError

__all__ = ["try_vest"]


def try_vest(case: Case) -> list[Finding]:
    """Open a vest, which begins with zeros, hear what it says of itself, close it."""
    driver = driver_class(case.driver, "vest")
    options = case.options
    if isinstance(driver, HarmlessDevice):
        options = driver.harmless(options)
    vest: Any = driver(case.options if options is None else options)
    label = vest.info.label
    if options is None:
        return [_finding(case, label, f"{case.driver} needs no device; it was not opened")]
    try:
        with vest:
            info = vest.info
    except TegaError as error:
        why, hint = bluetooth_trouble() if case.driver == "bhaptics-ble" else ("", "")
        if isinstance(error, MissingExtraError):
            why, hint = "", ""
        finding = failed(case, error, device=label, why=why)
        return [finding if not hint else _also(finding, hint)]
    doubts = [
        Finding(check=case.check, status="doubt", finding=note, driver=case.driver, device=label)
        for note in info.notes
    ]
    return [
        _finding(case, label, f"{case.driver}, {label}: the vest answers; it was sent zeros only"),
        *doubts,
    ]


def _also(finding: Finding, step: str) -> Finding:
    import msgspec

    return msgspec.structs.replace(finding, todo=(step, *finding.todo))


def _finding(case: Case, label: str, said: str) -> Finding:
    return Finding(check=case.check, status="fine", finding=said, driver=case.driver, device=label)
