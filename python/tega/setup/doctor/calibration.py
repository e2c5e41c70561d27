"""Check a run's calibration: whether it is there, of this person and these devices, and fresh enough.

Nothing is opened: devices are identified by the names they have while closed. Facts that only an open device knows,
such as its true rate, are checked when a run starts.
"""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

from tega.config import SessionConfig
from tega.config.calibration.folder import Part, device_name
from tega.config.calibration.records import EmgRecord, TouchRecord, VestCalibration, utc_now
from tega.config.calibration.store import load_calibration, refused_law
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
from tega.devices.base import DeviceInfo
from tega.errors import CalibrationError
from tega.setup.doctor.findings import Finding, Status


class CalibrationCheck(NamedTuple):
    """State of one part of a person's calibration: a finger, ``EMG``, ``vest``; no ``problem`` is ``""``.

    ``missing``: there is none; ``error``: it is not to be used; ``warning``: it is, but old or with a note.
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


CHECK: Final = "calibration"


def check_calibration(config: SessionConfig, *, settings: str, now: datetime | None = None) -> list[Finding]:
    """Look at the calibration that a run with some settings would use.

    Return nothing where none is needed, since no file is named and nothing is live.
    """
    file, person = config.calibration.file, config.calibration.person
    if file is not None:
        return [_of_a_file(config, file, settings)]
    if not _live(config):
        return []
    if person is None:
        return [_no_person(config, settings)]
    looked = look_at(config, settings=settings, now=now or utc_now())
    findings = [_finding(one) for one in looked if one.problem]
    fine = [one.what for one in looked if not one.problem]
    if fine:
        text = f"{person}'s calibration is there and fresh: {', '.join(fine)}"
        findings.insert(0, Finding(check=CHECK, status="ok", finding=text))
    return findings


def _live(config: SessionConfig) -> list[str]:
    """Name the live sources, which need a calibration."""
    found = [f for f, section in config.tactile.in_use().items() if live_info(section, "tactile") is not None]
    return found + ["EMG"] * (live_info(config.emg, "emg") is not None)


def _no_person(config: SessionConfig, settings: str) -> Finding:
    folder = config.calibration.folder or Path(settings).absolute().parent / "calibrations"
    people = sorted({file.parent.name for file in folder.glob("people/*/*.toml")})
    if people:
        them = ", ".join(people[:6]) + (" …" if len(people) > 6 else "")
        return Finding(
            check=CHECK,
            status="warning",
            finding=f"no person is named, so no calibration was looked at; there are those of {them}",
            why="a run on live devices needs one",
            todo=(
                f"look at one:\ntega-teleop doctor {settings} --person {people[0]}",
                f"run with it:\ntega-teleop run {settings} --person {people[0]}",
            ),
        )
    return Finding(
        check=CHECK,
        status="missing",
        finding=f"there is no calibration for {', '.join(_live(config))}",
        why="a run on live devices needs one, and does not start without",
        todo=(f"make one (ID is the person's code, such as p01):\n{calibrate_command(settings, 'ID')}",),
    )


def _of_a_file(config: SessionConfig, file: Path, settings: str) -> Finding:
    again = f"calibrate again:\n{calibrate_command(settings, 'ID')}"
    try:
        calibration = load_calibration(file)
        calibration.check_fits(
            preset=config.session.preset, fingers=config.tactile.in_use(), emg=None, name=file.name
        )
    except CalibrationError as error:
        status: Status = "error" if file.exists() else "missing"
        todo = tuple(step for step in (error.hint, again) if step)
        return Finding(check=CHECK, status=status, finding=error.message, todo=todo)
    wrong = ""
    if config.emg is not None:
        kind = None if calibration.emg is None else calibration.emg.kind
        if kind is None:
            wrong = f"{file.name}: has no EMG maxima"
        elif kind != config.emg.kind:
            wrong = f"{file.name}: made for emg kind = {kind!r}, the settings have {config.emg.kind!r}"
    if wrong:
        return Finding(check=CHECK, status="error", finding=wrong, todo=(again,))
    command = calibrate_command(settings, "ID", "touch")
    refused = [
        text for one in config.tactile.in_use() for text in refused_law(one, calibration.touch(one), command)
    ]
    if refused:
        return Finding(check=CHECK, status="warning", finding=f"{file.name}: {'; '.join(refused)}")
    text = f"the file {file.name} matches these settings, but names no participant, device or date"
    return Finding(check=CHECK, status="ok", finding=text)


def _finding(looked: CalibrationCheck) -> Finding:
    return Finding(
        check=CHECK,
        status=looked.status,
        finding=looked.problem,
        todo=(f"run this:\n{looked.command}",) if looked.command else (),
    )
