"""Check a run's calibration: whether it is there, of this person and these devices, and fresh enough.

Nothing is opened: devices are identified by the names they have while closed. Facts that only an open device knows,
such as its true rate, are checked when a run starts.
"""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Final

from tega.config.calibration.records import utc_now
from tega.config.calibration.store import load_calibration, refused_law
from tega.config.person import calibrate_command, live_info
from tega.errors import CalibrationError
from tega.setup.calibration.check import CalibrationCheck, look_at, people_with_calibrations
from tega.setup.doctor.findings import Finding, Status

if TYPE_CHECKING:
    from tega.config import SessionConfig


CHECK: Final = "calibration"


def check_calibration(config: SessionConfig, *, settings: str, now: datetime | None = None) -> list[Finding]:
    """Look at the calibration that a run with some settings would use.

    Returns:
        Nothing where none is needed, since nothing is live and none is named.
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
    people = people_with_calibrations(config, settings)
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
