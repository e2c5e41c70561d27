"""Check arm, forearm tracker, pedals and switches: whether they answer, fit and read as untouched. Nothing moves."""

from __future__ import annotations

import time
from typing import Any

from tega.config import ArmConfig, SessionConfig
from tega.devices import HarmlessDevice, driver_class
from tega.devices.base import PreflightedArm
from tega.errors import TegaError
from tega.setup.doctor.findings import DriverCase, Finding, failed

_POLL_S, _STEP_S = 1.5, 0.01
_LISTEN_S, _LISTEN_STEP_S = 1.0, 0.02


def try_arm(case: DriverCase) -> list[Finding]:
    """Query a robot without moving it; a driver that opens without consequences is opened."""
    driver: Any = driver_class(case.driver, "arm")
    if isinstance(driver, PreflightedArm):
        return _preflight(case, driver)
    options = driver.harmless(case.options) if isinstance(driver, HarmlessDevice) else None
    if options is None:
        text = f"{case.driver} was not opened: its driver does not say how to without moving the arm"
        todo = ("try it in tega-teleop run, with the stop within reach",)
        return [case.reported("", "warning", text, todo=todo)]
    arm = driver(options)
    try:
        with arm:
            until_s = time.monotonic() + _POLL_S
            while (seen := arm.measured()) is None and time.monotonic() < until_s:
                time.sleep(_STEP_S)
            time.sleep(_POLL_S / 3)  # so that its loop has a rate to report
            arm.measured()
            health = arm.health
    except TegaError as error:
        return [failed(case, error, device=arm.info.label)]
    label = arm.info.label
    if seen is None:
        return [case.reported(label, "error", f"{case.driver} opened, and did not say where its hand is")]
    x, y, z = map(float, seen.position_m)
    text = f"{case.driver} is open; its hand is at {x:.3f} {y:.3f} {z:.3f} m"
    measured = {"loop_hz": health.rate_hz, "worst_ms": health.worst_ms}
    return [case.reported(label, "ok", text, why="; ".join(arm.info.notes), measured=measured)]


def _preflight(case: DriverCase, driver: PreflightedArm) -> list[Finding]:
    try:
        findings = driver.preflight(case.options)
    except TegaError as error:
        return [failed(case, error, device=getattr(case.options, "host", ""))]
    device = getattr(case.options, "host", "")
    good = "; ".join(subject for ok, subject, _ in findings if ok)
    reported = [case.reported(device, "ok", good, why="asked without moving it")] if good else []
    return reported + [
        case.reported(device, "error", subject, todo=(fix,)) for ok, subject, fix in findings if not ok
    ]


def try_tracker(case: DriverCase) -> list[Finding]:
    """Open a tracker, listen for a moment, close it."""
    tracker: Any = driver_class(case.driver, "tracker")(case.options)
    poses: list[Any] = []
    try:
        with tracker:
            until_s = time.monotonic() + _POLL_S
            while time.monotonic() < until_s:
                poses += tracker.read(time.monotonic_ns())
                time.sleep(_STEP_S)
            problem, info = tracker.problem, tracker.info
    except TegaError as error:
        return [failed(case, error, device=tracker.info.label)]
    seen = sum(pose.valid for pose in poses)
    name = f"{case.driver} {info.label}"
    measured = {"poses_hz": len(poses) / _POLL_S, "seen_hz": seen / _POLL_S}
    if not poses:
        why = problem or "; ".join(info.notes)
        text = f"{name} opened, and gave no pose"
        return [case.reported(info.label, "error", text, why=why, measured=measured)]
    if not seen:
        text = f"{name} sends poses, and calls all of them lost"
        todo = ("hold the tracked forearm where the tracker sees it, and look again",)
        return [case.reported(info.label, "warning", text, why=problem, todo=todo, measured=measured)]
    text = f"{name} sees the forearm, {seen / _POLL_S:.0f} poses a second"
    return [case.reported(info.label, "ok", text, why=problem, measured=measured)]


def check_arm(config: SessionConfig) -> list[Finding]:
    """Check that the settings of an arm have the other parts they need."""
    arm = config.arm
    if arm is None:
        return []
    seats, findings = config.input.in_use(), []

    def wrong(text: str, todo: str) -> None:
        findings.append(Finding(check="arm", status="error", finding=text, todo=(todo,), driver=arm.driver))

    if "dead_man" not in seats:
        wrong(
            "no dead-man switch is set, and without one a run leads no arm",
            "set [input.dead_man], such as a pedal or a SpaceMouse's button",
        )
    if arm.tracker is None and "motion" not in seats:
        wrong(
            "nothing leads the arm: neither arm.tracker nor input.motion is set",
            "set [arm.tracker], or [input.motion] with a SpaceMouse",
        )
    frame = _frame(arm)
    if frame and frame != arm.mapping.frame:
        wrong(
            f"arm.mapping.frame is {arm.mapping.frame!r}, but what leads the arm gives poses in the axes {frame!r}",
            f"set arm.mapping.frame = {frame!r}",
        )
    return findings


def _frame(arm: ArmConfig) -> str:
    """Return the axes of the arm's pose source."""
    if arm.tracker is None:
        return "base"
    try:
        tracker: Any = driver_class(arm.tracker.driver, "tracker")(arm.tracker.options)
    except TegaError:  # reported where it is tried
        return ""
    return str(tracker.frame)


def try_input(case: DriverCase) -> list[Finding]:
    """Open an input device, read it for a moment, close it. A device that hangs at rest is not detected."""
    source: Any = driver_class(case.driver, "input")(case.options)
    try:
        with source:
            until_s = time.monotonic() + _LISTEN_S
            while (state := source.state()).live and time.monotonic() < until_s:
                time.sleep(_LISTEN_STEP_S)
            info = source.info
    except TegaError as error:
        refused = isinstance(error.__cause__, OSError)
        return [failed(case, error, device=source.info.label, status="error" if refused else None)]
    name = f"{case.driver} {info.label}"
    if not state.live:
        text, why = f"{name} opened, and then had no data", "; ".join(info.notes)
        todo = ("let it go, check its cable or battery, look again",)
        return [case.reported(info.label, "error", text, why=why, todo=todo)]
    doubts = [case.reported(info.label, "warning", f"{name}: {note}") for note in info.notes]
    touched = ["the cap is pushed or turned"] if any(state.motion) else []
    if touched := [*touched, *(f"{button} is down" for button in sorted(state.held))]:
        why = "harmless if you touch it just now; else it would move or release something by itself"
        text = f"{name} says that it is touched: {', '.join(touched)}"
        todo = ("let it go and look again",)
        return [case.reported(info.label, "warning", text, why=why, todo=todo), *doubts]
    why = "it reports nothing at rest: move it in tega-teleop run, which shows its values"
    return [case.reported(info.label, "ok", f"{name} is open and at rest", why=why), *doubts]
