"""Define the result of an examination: one record per finding, in the order of the loop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import msgspec

Status = Literal["ok", "warning", "error", "missing"]
"""``ok``; ``warning``: usable, with a limitation; ``error``: present but not usable; ``missing``: not found."""

_MISSING = 3


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
        return _MISSING if {f.status for f in self.findings} & {"error", "missing"} else 0

    def count(self, statuses: Sequence[Status]) -> int:
        """Return how many findings have one of the statuses."""
        return sum(f.status in statuses for f in self.findings)
