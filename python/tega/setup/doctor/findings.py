"""Define an examination's results, one record per finding in the order of the loop, and the devices it tries."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal, NamedTuple

import msgspec

from tega.devices.base import Kind
from tega.errors import SampleRateError, StreamContradictionError, TegaError, WrongDeviceError

Status = Literal["ok", "warning", "error", "missing"]
"""``ok``; ``warning``: usable, with a limitation; ``error``: present but not usable; ``missing``: not found."""


class Finding(msgspec.Struct, frozen=True, kw_only=True):
    """Finding about one device, or one part of the settings, one sentence.

    ``check`` is ``packages``, ``digit``, ``emg``, ``vest``, ``allegro``, ``calibration``, or a part of the
    settings such as ``tactile.thumb``. ``why`` is the cause, as far as it is known; ``todo`` are steps, one
    sentence each. ``device`` is a serial number, port or bus. ``measured`` holds numbers by a name that ends
    with the unit.
    """

    check: str
    status: Status
    finding: str
    why: str = ""
    todo: tuple[str, ...] = ()
    driver: str = ""
    device: str = ""
    measured: dict[str, float] = {}


class Examination(msgspec.Struct, frozen=True, kw_only=True):
    """All findings, in the order of the loop: touch, muscles, vest, hand; then the operator's inputs.

    ``settings`` is the base name of the settings file; ``""`` where none was given.
    """

    settings: str
    findings: tuple[Finding, ...]

    @property
    def exit_code(self) -> int:
        """0 where everything that was examined can be used, warnings included; else 3."""
        return 3 if {f.status for f in self.findings} & {"error", "missing"} else 0


_PROC = Path("/proc")


class DriverCase(NamedTuple):
    """A driver and its settings, for a check such as ``tactile.thumb``; the baseline is the untouched gel."""

    check: str
    kind: Kind
    driver: str
    options: Any
    baseline: Path | None = None

    def reported(
        self,
        device: str,
        status: Status,
        text: str,
        *,
        why: str = "",
        todo: tuple[str, ...] = (),
        measured: dict[str, float] | None = None,
    ) -> Finding:
        """Return a finding about this device; see :class:`~tega.setup.doctor.findings.Finding`."""
        return Finding(
            check=self.check,
            status=status,
            finding=text,
            why=why,
            todo=todo,
            driver=self.driver,
            device=device,
            measured=measured or {},
        )


def failed(
    case: DriverCase,
    error: TegaError,
    *,
    device: str = "",
    status: Status | None = None,
    why: str = "",
    todo: tuple[str, ...] = (),
) -> Finding:
    """Return the finding for a device that could not be used.

    The error's hint becomes a step to take, before those of ``todo``; ``why`` are further facts about the
    cause. A status of ``None`` goes by the kind of error.
    """
    if status is None:
        # The thing is there, but not the right one, not fast enough, or not for us.
        wrong = isinstance(error, WrongDeviceError | SampleRateError | StreamContradictionError)
        status = "error" if wrong or isinstance(error.__cause__, PermissionError) else "missing"
    steps = tuple(step for step in (error.hint, *todo) if step)
    return case.reported(device, status, error.message, why=why, todo=steps)


def holders(device: str) -> list[str]:
    """Name the programs, such as ``cheese (4711)``, that have a device open and this user may see (Linux)."""
    target, found = Path(device).resolve(), []
    for process in sorted(_PROC.glob("[0-9]*")):
        try:
            has_it = any(link.resolve() == target for link in (process / "fd").iterdir())
            name = (process / "comm").read_text().strip()
        except OSError:
            continue
        if has_it:
            found.append(f"{name} ({process.name})")
    return found
