"""Measure contacts in fingertip frames as the presets ``paper`` and ``live`` do."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.records import Contact, NamedValue
from tega.stages.base import FingerSetup, Metric, StageOptions, TouchMap
from tega.tactile import (
    ContactMetrics,
    ContactReader,
    GelLight,
    Outline,
    TouchTracker,
    TrackedContact,
    contact_mask,
    nominal_light,
    pressure_map,
)

# Fields of a contact that have the tracker's value.
_SAME: tuple[str, ...] = ("mass", "centroid_xy", "spread", "threshold", "eda", "cci", "peak", "in_contact")
_SAME += ("depth_mm", "force_n", "strength", "broad")
# Between the frames of a DIGIT, seconds, where their times do not say it.
_PERIOD_S = 1 / 60


def contact_record(finger: str, t_ns: int, metrics: ContactMetrics) -> Contact:
    """Return the kernels' measurements of a frame as a record."""
    return Contact(finger=finger, t_ns=t_ns, **metrics._asdict())


class PaperMetric(Metric):
    """Eq 1 to 6 on the masked, blurred difference: :func:`tega.tactile.read_contact` with ``reading="paper"``."""

    summary: ClassVar[str] = "the paper's equations with minimal safeguards"

    def __init__(self, setup: FingerSetup, _options: StageOptions) -> None:
        self._finger = setup.finger
        self._baseline, self._frame = setup.baseline, setup.baseline
        self._reader = ContactReader(setup.baseline, reading="paper")

    def update(self, frame: NDArray[np.uint8], t_ns: int) -> Contact:
        """Measure a frame."""
        self._frame = frame
        return contact_record(self._finger, t_ns, self._reader.read(frame))

    def touch_map(self) -> TouchMap:
        """Return the masked, blurred difference and the pixels of it that exceed T."""
        pictures = self._frame, self._baseline
        return TouchMap(pressure_map(*pictures, "paper"), "grey", contact_mask(*pictures, "paper"))


class LiveOptions(StageOptions, frozen=True):
    """Options of the metric ``live``.

    Attributes:
        outline: ``dent`` outlines the dent as an eye marks it, ``contact`` nearer to the touching area of a curved
            object.
        rezero: Whether the untouched gel is learned again a second after a release.
        mm_per_px: Scale of a picture of 320 x 240 pixels, for ``area_mm2``; none takes the calibration's, which knows
            it where a ball of known size and force was pressed, and else leaves the area out. Depth and force are
            nominal without such a press.
        trend: Measures the value ``trend_mm_s``, the rate of change of the dent's depth, for a column to show:
            ``rise`` while it grows, ``change`` whichever way; ``none`` does not measure it.
        trend_s: Time constant of that rate, seconds.
    """

    outline: Outline = "dent"
    rezero: bool = True
    mm_per_px: Annotated[float, msgspec.Meta(gt=0.001, lt=1.0)] | None = None
    trend: Literal["none", "rise", "change"] = "none"
    trend_s: Annotated[float, msgspec.Meta(ge=0.01, le=5.0)] = 0.1


class LiveMetric(Metric):
    """Touch with a memory: :class:`tega.tactile.TouchTracker`, one for each finger."""

    summary: ClassVar[str] = "graded contact with hysteresis; CCI rises with the press"
    memory: ClassVar[bool] = True
    version: ClassVar[int] = 12
    options_type: ClassVar[type[StageOptions]] = LiveOptions

    @classmethod
    def units(cls, options: StageOptions) -> dict[str, str]:
        """Return the unit of the trend, where it is measured."""
        measured = isinstance(options, LiveOptions) and options.trend != "none"
        return {"trend_mm_s": "mm/s"} if measured else {}

    def __init__(self, setup: FingerSetup, options: LiveOptions) -> None:
        self._finger = setup.finger
        self._trend, self._trend_s = options.trend, options.trend_s
        self._depth_mm = 0.0
        gel = setup.gel
        scale = options.mm_per_px or gel.mm_per_px
        self._scaled = scale is not None
        light = None
        if scale is not None or gel.depth_gain is not None or gel.stiffness_n_mm3 is not None:
            nominal, gain = nominal_light(), gel.depth_gain or 1.0
            light = GelLight(
                tuple(
                    tuple(tuple(term / gain for term in axis) for axis in colour) for colour in nominal.terms
                ),
                scale or nominal.mm_per_px,
                gel.stiffness_n_mm3 or nominal.stiffness_n_mm3,
            )
        self._tracker = TouchTracker(
            setup.baseline,
            noise=gel.noise_counts,
            light=light,
            outline=options.outline,
            rezero=options.rezero,
        )
        self._last_ns: int | None = None

    @property
    def bears_load(self) -> bool:
        """Whether the last frame showed a contact that has not just fallen."""
        return self._tracker.bears_load

    def rezero(self) -> bool:
        """Take the last picture for that of the untouched gel."""
        return self._tracker.rezero()

    def update(self, frame: NDArray[np.uint8], t_ns: int) -> Contact:
        """Measure a frame."""
        dt_s = self._since_s(t_ns)
        return self._contact(self._tracker.update(frame, dt_s=dt_s, loaded=self.loaded), t_ns, dt_s)

    def update_sums(self, sums: NDArray[np.int16], t_ns: int) -> Contact:
        """Measure a frame by its sums."""
        dt_s = self._since_s(t_ns)
        return self._contact(self._tracker.update_sums(sums, dt_s=dt_s, loaded=self.loaded), t_ns, dt_s)

    def _since_s(self, t_ns: int) -> float | None:
        """Return the time since the previous frame; one period for the first, or if the time does not rise."""
        dt_s = None if self._last_ns is None or t_ns <= self._last_ns else (t_ns - self._last_ns) / 1e9
        self._last_ns = t_ns
        return dt_s

    def _contact(self, found: TrackedContact, t_ns: int, dt_s: float | None) -> Contact:
        more = () if self._trend == "none" else (self._rate(found.depth_mm, dt_s or _PERIOD_S),)
        x, y = found.centroid_xy
        return Contact(
            finger=self._finger,
            t_ns=t_ns,
            peak_xy=(round(x), round(y)) if found.in_contact else (0, 0),
            area_mm2=found.area_mm2 if self._scaled else None,
            more=more,
            **{name: getattr(found, name) for name in _SAME},
        )

    def _rate(self, depth_mm: float, dt_s: float) -> NamedValue:
        """Return how fast the depth changes: its difference to its own low-pass over that one's time constant."""
        off_mm = depth_mm - self._depth_mm
        self._depth_mm += -math.expm1(-dt_s / self._trend_s) * off_mm
        rate_mm_s = off_mm / self._trend_s
        rate_mm_s = abs(rate_mm_s) if self._trend == "change" else max(rate_mm_s, 0.0)
        return NamedValue("trend_mm_s", rate_mm_s, "mm/s")

    def touch_map(self) -> TouchMap:
        """Return the depth that shading shows, a value a cell, and the outlined pixels."""
        return TouchMap(self._tracker.depth_map(), "mm", self._tracker.mask())
