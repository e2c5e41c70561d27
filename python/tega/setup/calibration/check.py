"""Check a person's calibration without a run, and without opening a device."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from tega.config.calibration.folder import Part, device_name
from tega.config.calibration.records import EmgRecord, TouchRecord, VestCalibration
from tega.config.person import (
    calibrate_command,
    driver_settings,
    emg_warnings,
    live_info,
    needed_record,
    other_conditions,
    touch_warnings,
    vest_warnings,
    whose,
)
from tega.errors import CalibrationError

if TYPE_CHECKING:
    from tega.config import SessionConfig
    from tega.devices.base import DeviceInfo


class CalibrationCheck(NamedTuple):
    """State of one part of a person's calibration.

    Attributes:
        what: The part: a finger, ``EMG``, ``vest``.
        problem: Problem with it; ``""`` for none.
        command: Command to run about it.
        status: ``missing``: there is none; ``wrong``: it is not to be used; ``doubt``: it is, but old or with a note.
    """

    what: str
    problem: str = ""
    command: str = ""
    status: Literal["warning", "error", "missing"] = "warning"


def look_at(config: SessionConfig, *, settings: str, now: datetime) -> list[CalibrationCheck]:
    """Check a person's records for the live devices of some settings, as far as possible without opening these."""
    person, folder = whose(config.calibration)
    found: list[CalibrationCheck] = []

    def check(subject: str, wanted: type[Any], info: DeviceInfo | None) -> Any:
        if info is None:
            return None
        part: Part = "touch" if wanted is TouchRecord else "emg"
        try:
            return needed_record(folder, person, wanted, info, subject=subject, settings=settings)
        except CalibrationError as error:
            there = folder.file(person, part, device_name(info)).is_file()
            found.append(
                CalibrationCheck(subject, error.message, error.hint, "error" if there else "missing")
            )
            return None

    def warned(subject: str, warnings: list[str]) -> None:
        for warning in warnings:
            text, begins, rest = warning.partition(": tega-teleop ")
            found.append(CalibrationCheck(subject, text, f"tega-teleop {rest}" if begins else ""))
        if not warnings:
            found.append(CalibrationCheck(subject))

    for finger, section in config.tactile.in_use().items():
        if (record := check(finger, TouchRecord, live_info(section, "tactile"))) is not None:
            warned(finger, touch_warnings(config, folder, finger, record, settings=settings, now=now))
    emg = config.emg
    if (record := check("EMG", EmgRecord, live_info(emg, "emg"))) is not None and emg is not None:
        text = other_conditions(record, driver=emg.driver, kind=emg.kind, settings=driver_settings(emg))
        if text:
            found.append(CalibrationCheck("EMG", text, calibrate_command(settings, person, "emg"), "error"))
        else:
            warned("EMG", emg_warnings(record, config, settings=settings, now=now))
    if (info := live_info(config.vest, "vest")) is not None and config.session.preset == "live":
        try:
            worn = folder.record(person, VestCalibration, device_name(info))
            fit = "" if worn is None else f" ({worn.named_right} of {worn.named} places named right)"
            warned(f"vest{fit}", vest_warnings(config, folder, person, settings=settings, now=now))
        except CalibrationError as error:
            command = calibrate_command(settings, person, "vest")
            found.append(CalibrationCheck("vest", f"vest: {error.message}", command, "error"))
    return found


def people_with_calibrations(config: SessionConfig, settings: str) -> list[str]:
    """Return the people with calibrations in the folder of some settings."""
    folder = config.calibration.folder or Path(settings).absolute().parent / "calibrations"
    return sorted({file.parent.name for file in folder.glob("people/*/*.toml")})
