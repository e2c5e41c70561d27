"""Try exactly the devices that a settings file names, and check the calibration that a run with them would use.

The calibration is checked without opening: devices are identified by the names they have while closed. Facts that only
an open device knows, such as its true rate, are checked when a run starts.
"""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Any, Final

import msgspec

from tega.config import SessionConfig
from tega.config.calibration.folder import device_name, part_of
from tega.config.calibration.records import EmgRecord, TouchRecord, VestCalibration, utc_now
from tega.config.calibration.store import load_calibration, refused_law
from tega.config.person import (
    PersonRecords,
    calibrate_command,
    driver_settings,
    live_info,
    other_conditions,
)
from tega.devices.base import DeviceInfo, Kind
from tega.errors import CalibrationError, TegaError
from tega.loop.rig import names_input
from tega.runtime.features import Feature, call_feature, call_member, having
from tega.setup.doctor.arm import check_arm
from tega.setup.doctor.bench import try_all
from tega.setup.doctor.findings import DriverCase, Examination, Finding, Status

CHECK: Final = "calibration"
DEADLINE_S: Final = 30.0
"""Deadline of everything: a slow amplifier measures its rate for ten seconds before it is refused."""


def _about(status: Status, text: str, *steps: str, why: str = "") -> Finding:
    """Return a finding about the calibration, with the steps to take; an empty one is none."""
    return Finding(check=CHECK, status=status, finding=text, why=why, todo=tuple(filter(None, steps)))


def _run(command: str) -> str:
    return f"run this:\n{command}" if command else ""


def _looked_at(config: SessionConfig, *, settings: str, now: datetime) -> list[Finding]:
    """Check a person's records for the live devices of some settings, as far as possible without opening these.

    First comes what is there and fresh. ``missing``: there is none; ``error``: it is not to be used; ``warning``:
    it is, but old or with a note.
    """
    records = PersonRecords(config, settings=settings, now=now)
    person, folder = records.person, records.folder
    fine: list[str] = []
    found: list[Finding] = []

    def check(subject: str, wanted: type[Any], info: DeviceInfo | None) -> Any:
        if info is None:
            return None
        try:
            return records.needed(wanted, info, subject)
        except CalibrationError as error:
            there = folder.file(person, part_of(wanted), device_name(info)).is_file()
            found.append(_about("error" if there else "missing", error.message, _run(error.hint)))
            return None

    def warned(subject: str, warnings: list[str]) -> None:
        for warning in warnings:
            text, begins, rest = warning.partition(": tega-teleop ")
            found.append(_about("warning", text, _run(f"tega-teleop {rest}" if begins else "")))
        if not warnings:
            fine.append(subject)

    for finger, section in config.tactile.items():
        if (record := check(finger, TouchRecord, live_info(section, "tactile"))) is not None:
            warned(finger, records.touch_warnings(finger, record))
    emg = config.emg
    if (record := check("EMG", EmgRecord, live_info(emg, "emg"))) is not None and emg is not None:
        text = other_conditions(record, driver=emg.driver, kind=emg.kind, settings=driver_settings(emg))
        if text:
            found.append(_about("error", text, _run(records.command("emg"))))
        else:
            warned("EMG", records.emg_warnings(record))
    if (info := live_info(config.vest, "vest")) is not None and config.session.preset == "live":
        try:
            worn = folder.record(person, VestCalibration, device_name(info))
            fit = "" if worn is None else f" ({worn.named_right} of {worn.named} places named right)"
            warned(f"vest{fit}", records.vest_warnings())
        except CalibrationError as error:
            found.append(_about("error", f"vest: {error.message}", _run(records.command("vest"))))
    if fine:
        found.insert(0, _about("ok", f"{person}'s calibration is there and fresh: {', '.join(fine)}"))
    return found


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
    return _looked_at(config, settings=settings, now=now or utc_now())


def _live(config: SessionConfig) -> list[str]:
    """Name the live sources, which need a calibration."""
    found = [f for f, section in config.tactile.items() if live_info(section, "tactile") is not None]
    return found + ["EMG"] * (live_info(config.emg, "emg") is not None)


def _no_person(config: SessionConfig, settings: str) -> Finding:
    folder = config.calibration.folder or Path(settings).absolute().parent / "calibrations"
    people = sorted({file.parent.name for file in folder.glob("people/*/*.toml")})
    if people:
        them = ", ".join(people[:6]) + (" …" if len(people) > 6 else "")
        return _about(
            "warning",
            f"no person is named, so no calibration was looked at; there are those of {them}",
            f"look at one:\ntega-teleop doctor {settings} --person {people[0]}",
            f"run with it:\ntega-teleop run {settings} --person {people[0]}",
            why="a run on live devices needs one",
        )
    return _about(
        "missing",
        f"there is no calibration for {', '.join(_live(config))}",
        f"make one (ID is the person's code, such as p01):\n{calibrate_command(settings, 'ID')}",
        why="a run on live devices needs one, and does not start without",
    )


def _of_a_file(config: SessionConfig, file: Path, settings: str) -> Finding:
    again = f"calibrate again:\n{calibrate_command(settings, 'ID')}"
    try:
        calibration = load_calibration(file)
        calibration.check_fits(preset=config.session.preset, fingers=config.tactile, emg=None, name=file.name)
    except CalibrationError as error:
        return _about("error" if file.exists() else "missing", error.message, error.hint, again)
    wrong = ""
    if config.emg is not None:
        kind = None if calibration.emg is None else calibration.emg.kind
        if kind is None:
            wrong = f"{file.name}: has no EMG maxima"
        elif kind != config.emg.kind:
            wrong = f"{file.name}: made for emg kind = {kind!r}, the settings have {config.emg.kind!r}"
    if wrong:
        return _about("error", wrong, again)
    command = calibrate_command(settings, "ID", "touch")
    refused = [text for one in config.tactile for text in refused_law(one, calibration.touch(one), command)]
    if refused:
        return _about("warning", f"{file.name}: {'; '.join(refused)}")
    return _about(
        "ok", f"the file {file.name} matches these settings, but names no participant, device or date"
    )


def examine(config: SessionConfig, *, name: str, settings: str = "") -> Examination:
    """Open every device that the settings name, read it for a moment, close it.

    The calibration that a run would use is checked as well. A hand's motors stay off, a vest gets zeros, and outputs
    that would overwrite a file are not opened.
    """
    cases = cases_of(config)
    no_input = _no_input(config)
    if not cases and not config.guests:
        return Examination(settings=name, findings=tuple(no_input))
    findings = try_all(cases, DEADLINE_S)
    calibration = check_calibration(config, settings=settings or name)
    others = check_arm(config)
    for feature in having("checks"):
        others += _of_feature(feature, config)
    return Examination(settings=name, findings=(*no_input, *findings, *others, *calibration))


def _of_feature(feature: Feature, config: SessionConfig) -> list[Finding]:
    """Return the findings of a feature's check, or one that the check fails."""
    try:
        found = call_member(feature, "checks", config)
        findings: list[Finding] = call_feature(
            feature,
            f"checks {feature.checks}",
            lambda: msgspec.convert(msgspec.to_builtins(list(found)), list[Finding]),
        )
    except TegaError as error:
        return [Finding(check=feature.name, status="error", finding=error.message, todo=(error.hint,))]
    return findings


def _no_input(config: SessionConfig) -> list[Finding]:
    """Find that `run` would refuse the settings because nothing in them gives input."""
    if names_input(config) or config.guests:  # a feature's table may bring input, such as a second station's
        return []
    return [
        Finding(
            check="settings",
            status="error",
            finding="the settings name no input: no fingertip camera, no EMG amplifier and no arm",
            why="`run` refuses such settings",
            todo=(
                "plug a device in, and write new settings: tega-teleop init",
                "or rehearse on emulated devices: tega-teleop init --emulated",
            ),
        )
    ]


def cases_of(config: SessionConfig) -> list[DriverCase]:
    """Return the devices that a session's settings name."""
    named: list[tuple[str, Kind, Any]] = [(f"tactile.{f}", "tactile", c) for f, c in config.tactile.items()]
    named += [("emg", "emg", config.emg), ("vest", "vest", config.vest), ("hand", "hand", config.hand)]
    named += [(f"input.{seat}", "input", c) for seat, c in config.input.in_use().items()]
    if config.arm is not None:
        named += [("arm.tracker", "tracker", config.arm.tracker), ("arm", "arm", config.arm)]
    return [
        DriverCase(check, kind, section.driver, section.options, getattr(section, "baseline", None))
        for check, kind, section in named
        if section is not None and section.driver is not None
    ]
