"""Check the vest: whether it can be reached, and the status that it reports. Only zeros are ever sent to it."""

from __future__ import annotations

from typing import Any, Final

from tega.devices import HarmlessDevice, driver_class
from tega.devices.base import optional
from tega.devices.machine import bluetooth_trouble
from tega.errors import MissingExtraError, TegaError
from tega.setup.doctor.case import DriverCase, failed
from tega.setup.doctor.findings import Finding

_ASK: Final = (
    "the vest cannot detect its own fit. Check it with the participant:\n"
    "tega-teleop calibrate SETTINGS.toml --person ID --only vest"
)


def try_vest(case: DriverCase) -> list[Finding]:
    """Open a vest, which begins with zeros, read the status that it reports, close it."""
    driver = driver_class(case.driver, "vest")
    options = case.options
    if isinstance(driver, HarmlessDevice):
        options = driver.harmless(options)
    vest: Any = driver(case.options if options is None else options)
    label = vest.info.label
    if options is None:
        return [case.reported(label, "ok", f"{case.driver} needs no device; it was not opened")]
    try:
        with vest:
            info, condition, battery = (
                vest.info,
                optional(vest, "condition"),
                optional(vest, "battery_percent"),
            )
    except TegaError as error:
        why, hint = bluetooth_trouble() if case.driver == "bhaptics-ble" else ("", "")
        if isinstance(error, MissingExtraError):
            why, hint = "", ""
        return [failed(case, error, device=label, why=why, todo=(hint,))]
    text = f"{case.driver}, {label}: the vest answers{f' ({condition})' if condition else ''}; it was sent zeros only"
    measured = {} if battery is None else {"battery_percent": float(battery)}
    return [
        case.reported(label, "ok", text, measured=measured, todo=(_ASK,) if condition else ()),
        *(case.reported(label, "warning", note) for note in info.notes),
    ]
