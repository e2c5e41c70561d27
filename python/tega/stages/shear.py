"""Measure contacts as the preset ``live`` does, and with them shear and incipient slip."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import msgspec

from tega.records import Contact, NamedValue
from tega.stages.base import FingerSetup, StageOptions
from tega.stages.metrics import LiveMetric, LiveOptions
from tega.tactile.shear import ShearReader

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_PERIOD_S = 1 / 60
_UNITS = {
    "shear_mm": "mm",
    "shear_direction_rad": "rad",
    "incipient": "1",
    "slip_mm_s": "mm/s",
    "shear_sure": "1",
}


class ShearMetric(LiveMetric):
    """Touch as ``live`` has it, and five values more: :class:`tega.tactile.shear.ShearReader`, one for each finger.

    ``shear_mm`` and ``shear_direction_rad`` say how far and where the gel is pulled, ``incipient`` which share of the
    contact has slid against the rest, ``slip_mm_s`` how fast it does, ``shear_sure`` how well the grain was found
    again. All are 0 without contact.
    """

    summary: ClassVar[str] = "as live, and how far the gel is pulled sideways and how much of it has slid"
    version: ClassVar[int] = 4

    @classmethod
    def units(cls, options: StageOptions) -> dict[str, str]:
        """Return the unit of each value of its own."""
        return {**super().units(options), **_UNITS}

    def __init__(self, setup: FingerSetup, options: LiveOptions) -> None:
        super().__init__(setup, options)
        scale = options.mm_per_px or setup.gel.mm_per_px
        self._reader = ShearReader(setup.baseline, mm_per_px=scale)

    def update(self, frame: NDArray[np.uint8], t_ns: int) -> Contact:
        """Measure a frame."""
        last_ns = self._last_ns
        contact = super().update(frame, t_ns)
        dt_s = _PERIOD_S if last_ns is None or t_ns <= last_ns else (t_ns - last_ns) / 1e9
        values: tuple[float, ...] = self._reader.update(frame, self._tracker, dt_s=dt_s)
        if not contact.in_contact:
            values = (0.0,) * len(_UNITS)
        told = zip(_UNITS.items(), values, strict=True)
        more = tuple(NamedValue(name, value, unit) for (name, unit), value in told)
        return msgspec.structs.replace(contact, more=contact.more + more)
