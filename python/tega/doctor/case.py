"""One device to try, and how a failure to open it is told."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from tega.devices.base import Kind
from tega.doctor.findings import Finding, Status
from tega.errors import MissingExtraError, SampleRateError, TegaError, WrongDeviceError

__all__ = ["Case", "failed", "holders", "late"]

_PROC = Path("/proc")


class Case(NamedTuple):
    """A driver and its settings.

    Attributes:
        check: What the findings are about, such as ``tactile.thumb``.
        kind: Kind of the driver.
        driver: Its name.
        options: Its checked options.
        baseline: Picture of the untouched gel, for a finger that has one.
    """

    check: str
    kind: Kind
    driver: str
    options: Any
    baseline: Path | None = None


def failed(
    case: Case, error: TegaError, *, device: str = "", status: Status | None = None, why: str = ""
) -> Finding:
    """Return the finding for a device that could not be used.

    Args:
        case: What was tried.
        error: What the driver says; its hint becomes what to do.
        device: What the device is called.
        status: How it is; by the kind of error when ``None``.
        why: What is known beyond the error.
    """
    if status is None:
        wrong = isinstance(error, WrongDeviceError | SampleRateError) or _is_local(error)
        status = "wrong" if wrong else "missing"
    return Finding(
        check=case.check,
        status=status,
        finding=error.message,
        why=why,
        todo=(error.hint,) if error.hint else (),
        driver=case.driver,
        device=device,
    )


def _is_local(error: TegaError) -> bool:
    """Tell whether the cause of an error says that the thing is there, but not for us."""
    return not isinstance(error, MissingExtraError) and isinstance(error.__cause__, PermissionError)


def late(case: Case, deadline_s: float) -> Finding:
    """Return the finding for a device that did not answer in time."""
    return Finding(
        check=case.check,
        status="wrong",
        finding=f"{case.driver} was not done within {deadline_s:g} s",
        why="the device, its driver or the machine is held up",
        todo=("unplug it, plug it in again and look once more",),
        driver=case.driver,
    )


def holders(device: str, proc: Path = _PROC) -> list[str]:
    """Name the programs that have a device open, as far as this user may see them (Linux only).

    Args:
        device: Its file, such as ``/dev/video0``.
        proc: Where the kernel lists processes.

    Returns:
        Name and number of each, such as ``cheese (4711)``.
    """
    target, found = Path(device).resolve(), []
    for process in sorted(proc.glob("[0-9]*")):
        try:
            has_it = any(link.resolve() == target for link in (process / "fd").iterdir())
            name = (process / "comm").read_text().strip()
        except OSError:
            continue
        if has_it:
            found.append(f"{name} ({process.name})")
    return found
