"""Try exactly the devices that a settings file names."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from typing import Final

import msgspec

from tega.config import SessionConfig
from tega.errors import TegaError
from tega.loop.rig import names_input
from tega.runtime.features import Feature, call_feature, call_member, having
from tega.setup.doctor.arm import check_arm
from tega.setup.doctor.bench import try_all
from tega.setup.doctor.calibration import check_calibration
from tega.setup.doctor.findings import DriverCase, Examination, Finding

DEADLINE_S: Final = 30.0
"""Deadline of everything: a slow amplifier measures its rate for ten seconds before it is refused."""

# Options that say which device is meant; two parts of a session with the same ones mean one device.
_IDENTITY = ("serial", "source", "port", "address", "value", "channel", "folder", "file")


def examine(config: SessionConfig, *, name: str, settings: str = "") -> Examination:
    """Open every device that the settings name, read it for a moment, close it.

    The calibration that a run would use is checked as well. A hand's motors stay off, a vest gets zeros, and outputs
    that would overwrite a file are not opened.
    """
    cases = cases_of(config)
    no_input = _no_input(config)
    if not cases and not config.guests:
        return Examination(settings=name, findings=tuple(no_input))
    twice = _same_device(cases)
    # Opened twice at once, a device would only complain about that.
    left = {id(case) for case, _ in twice}
    findings = try_all([case for case in cases if id(case) not in left], DEADLINE_S)
    calibration = check_calibration(config, settings=settings or name)
    others = [finding for _, finding in twice] + check_arm(config)
    for feature in having("checks"):
        others += _of_feature(feature, config)
    return Examination(settings=name, findings=(*no_input, *findings, *others, *calibration))


def _of_feature(feature: Feature, config: SessionConfig) -> list[Finding]:
    """Return the findings of a feature's check, or one that the check fails."""
    try:
        found = call_member(feature, "checks", config)
        findings: list[Finding] = call_feature(feature, f"checks {feature.checks}", _findings, found)
    except TegaError as error:
        return [Finding(check=feature.name, status="error", finding=error.message, todo=(error.hint,))]
    return findings


def _findings(found: Iterable[Finding]) -> list[Finding]:
    return msgspec.convert(msgspec.to_builtins(list(found)), list[Finding])


def _no_input(config: SessionConfig) -> list[Finding]:
    """Find that `run` would refuse the settings because nothing in them gives input."""
    if (
        names_input(config) or config.guests
    ):  # a feature's table may bring input, such as that of a second station
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
    cases = [
        DriverCase(f"tactile.{finger}", "tactile", section.driver, section.options, section.baseline)
        for finger, section in config.tactile.in_use().items()
    ]
    if config.emg is not None:
        cases.append(DriverCase("emg", "emg", config.emg.driver, config.emg.options))
    if config.vest.driver is not None:
        cases.append(DriverCase("vest", "vest", config.vest.driver, config.vest.options))
    if config.hand.driver is not None:
        cases.append(DriverCase("hand", "hand", config.hand.driver, config.hand.options))
    cases += [
        DriverCase(f"input.{seat}", "input", section.driver, section.options)
        for seat, section in config.input.in_use().items()
    ]
    if (arm := config.arm) is not None:
        if arm.tracker is not None:
            cases.append(DriverCase("arm.tracker", "tracker", arm.tracker.driver, arm.tracker.options))
        cases.append(DriverCase("arm", "arm", arm.driver, arm.options))
    return cases


def _same_device(cases: list[DriverCase]) -> list[tuple[DriverCase, Finding]]:
    """Find parts of the settings that name the device of an earlier part."""
    users: defaultdict[str, list[DriverCase]] = defaultdict(list)
    for case in cases:
        if case.kind == "input":
            continue  # one SpaceMouse may have several seats
        for key in _IDENTITY:
            value = getattr(case.options, key, None)
            if not value:
                continue
            # A port is a port, whoever opens it; anything else is its driver's own business.
            name = str(value) if str(value).startswith("/dev/") else f"{case.driver} {key} {value}"
            users[name].append(case)
    found = []
    why, todo = (
        "one device cannot be two",
        ("look at the numbers printed on the devices and correct the settings",),
    )
    for name, (first, *others) in users.items():
        for case in others:
            text = f"{case.check} and {first.check} name the same device: {name}"
            found.append((case, case.reported(name, "error", text, why=why, todo=todo)))
    return found
