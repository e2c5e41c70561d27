"""Choose the device to accept, run its steps, and gather the report."""

from __future__ import annotations

import importlib.metadata
import platform
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Any, Final

import msgspec

from tega.arm.settings import GateSettings
from tega.config import DEFAULT_LAYOUT, SessionConfig
from tega.devices import driver_class
from tega.devices.base import optional
from tega.errors import ConfigError, TegaError
from tega.loop.worn_vest import dose_file, worn_vest
from tega.setup.doctor.bench import try_all
from tega.setup.doctor.findings import DriverCase
from tega.setup.doctor.settings import cases_of
from tega_bench.acceptance.arm import accept_arm
from tega_bench.acceptance.leading import accept_input, accept_tracker
from tega_bench.acceptance.outputs import accept_hand, accept_vest, least_options, skipped_steps
from tega_bench.acceptance.report import STEPS, AcceptanceGuide, AcceptanceReport, AcceptanceStep
from tega_bench.acceptance.sensors import accept_amplifier, accept_camera, reopen_step

_POLL_S: Final = 30.0


def acceptance_case(config: SessionConfig, name: str) -> DriverCase:
    """Return the device of the settings that is meant; ``ConfigError`` unless there is exactly one.

    ``name`` is its part of the settings, such as ``vest`` or ``tactile.thumb``; the last word alone will do.
    """
    cases = cases_of(config)
    meant = [case for case in cases if case.check == name] or [
        case for case in cases if case.check.rpartition(".")[2] == name
    ]
    if len(meant) == 1:
        return meant[0]
    known = ", ".join(case.check for case in cases) or "no device"
    raise ConfigError(f"acceptance: the settings name no device {name!r}", f"they name {known}")


def accept_device(
    config: SessionConfig, case: DriverCase, guide: AcceptanceGuide, *, answered: bool
) -> AcceptanceReport:
    """Lead through the first hour of a device.

    What goes wrong ends the steps, is one of them, and leaves the device closed.
    """
    made = datetime.now(UTC)
    stands = guide.ask("Which device is before you: maker, model, firmware? (or: emulated)")
    driver: Any = driver_class(case.driver, case.kind)
    device = driver(case.options).info.label
    steps: list[AcceptanceStep] = []
    try:
        for step in _steps(config, case, guide):
            steps.append(step)
            guide.say(f"{step.status}: {step.name}: {step.said}")
    except TegaError as error:
        # Of the step that comes next: what was before it is kept.
        name = STEPS[min(len(steps), len(STEPS) - 1)]
        todo = error.hint or "look at its page"
        steps.append(AcceptanceStep(name=name, status="failed", said=error.message, todo=todo))
    answers = {"Which device is before you?": stands}
    steps[0] = msgspec.structs.replace(steps[0], answers=answers | steps[0].answers)
    return AcceptanceReport(
        made=made,
        tega=importlib.metadata.version("tega"),
        system=f"{platform.system()} {platform.release()}, {platform.machine()}, Python {platform.python_version()}",
        check=case.check,
        kind=case.kind,
        driver=case.driver,
        device=device,
        # No path, name or key.
        options={
            name: str(value).lower() if isinstance(value, bool) else f"{value:g}"
            for name, value in msgspec.structs.asdict(case.options).items()
            if isinstance(value, bool | int | float)
        },
        answered=answered,
        steps=tuple(steps),
    )


def _steps(config: SessionConfig, case: DriverCase, guide: AcceptanceGuide) -> Iterator[AcceptanceStep]:
    driver: Any = driver_class(case.driver, case.kind)
    least = least_options(case.options) if case.kind == "vest" else None
    if least is not None:
        section = msgspec.structs.replace(config.vest, options=least)
        layout: Any = config.vest.layout or DEFAULT_LAYOUT[config.session.preset]
        with worn_vest(section, dose_file(config.calibration)) as vest:
            parts = (vest.info.label, optional(vest, "condition"), *vest.info.notes)
            yield AcceptanceStep(name="identity", status="passed", said="; ".join(filter(None, parts)))
            yield from accept_vest(vest, layout, least.limit, guide)
        return
    found = _found(case)
    yield found
    if found.status == "failed" and case.kind != "vest":
        return
    if case.kind in {"tactile", "emg"}:
        with driver(case.options) as source:
            yield from (accept_camera if case.kind == "tactile" else accept_amplifier)(source, guide)
            yield reopen_step(source)
    elif case.kind == "hand":
        yield from accept_hand(driver, case.options, guide, found.measured)
    elif case.kind == "arm" and config.arm is not None:
        yield from accept_arm(config, config.arm, guide)
    elif case.kind == "tracker":
        gate = GateSettings() if config.arm is None else config.arm.gate
        with driver(case.options) as tracker:
            yield from accept_tracker(tracker, gate, guide)
    elif case.kind == "input":
        with driver(case.options) as source:
            yield from accept_input(source, guide)
    elif case.kind == "vest":
        yield from skipped_steps(STEPS[1:], "its driver has no limit of strength")


def _found(case: DriverCase) -> AcceptanceStep:
    """Return what ``doctor`` says of a device that is opened without force."""
    findings = try_all([case], _POLL_S)
    bad = [f for f in findings if f.status in {"error", "missing"}]
    doubts = [f for f in findings if f.status == "warning"]
    measured = {k: v for f in findings for k, v in f.measured.items()}
    text = "; ".join(f"{f.finding} ({f.why})" if f.why else f.finding for f in findings)
    todo = "; ".join(step for f in (*bad, *doubts) for step in f.todo)
    status: Any = "failed" if bad else "look" if doubts else "passed"
    return AcceptanceStep(name="identity", status=status, said=text, todo=todo, measured=measured)
