"""Measure fingertip frames as the two presets do."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar

import msgspec

from tega.records import Contact, NamedValue
from tega.stages.base import FingerSetup, Metric, StageOptions
from tega.tactile import ContactMetrics, ContactReader, Outline, TouchTracker, contact_mask, nominal_light

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["LiveMetric", "LiveOptions", "PaperMetric", "contact_metrics_of", "contact_record"]


NoiseCounts = Annotated[float, msgspec.Meta(gt=0, le=255)]


def contact_record(finger: str, t_ns: int, metrics: ContactMetrics) -> Contact:
    """Return what the kernels measured in a frame as a record."""
    return Contact(finger=finger, t_ns=t_ns, **metrics._asdict())


# Numbers of a contact that the kernels' own result has no place for.
_FURTHER = {"area_mm2": "mm²", "depth_mm": "mm", "force_n": "N", "strength": "1", "broad": "1"}


def contact_metrics_of(contact: Contact) -> ContactMetrics:
    """Return a record in the form that the loop passes on; what the kernels do not know becomes a named value."""
    further = tuple(
        NamedValue(name, value, unit)
        for name, unit in _FURTHER.items()
        if (value := getattr(contact, name)) is not None
    )
    return ContactMetrics(
        contact.mass,
        contact.centroid_xy,
        contact.spread,
        contact.threshold,
        contact.eda,
        contact.cci,
        contact.peak,
        contact.peak_xy,
        contact.in_contact,
        further + contact.more,
    )


class PaperMetric(Metric):
    """Eq 1 to 6 on the masked, blurred difference: :func:`tega.tactile.read_contact` with ``reading="paper"``."""

    summary: ClassVar[str] = "the printed law and the least that keeps it from breaking"

    def __init__(self, setup: FingerSetup, _options: StageOptions) -> None:
        self._finger, self._baseline = setup.finger, setup.baseline
        self._reader = ContactReader(setup.baseline, reading="paper")

    def update(self, frame: NDArray[np.uint8], t_ns: int) -> Contact:
        """Measure a frame."""
        return contact_record(self._finger, t_ns, self._reader.read(frame))

    def area(self, frame: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """Return the pixels above the threshold."""
        return contact_mask(frame, self._baseline, reading="paper")


class LiveOptions(StageOptions, frozen=True):
    """Options of the metric ``live``.

    Attributes:
        outline: ``dent`` outlines the dent as an eye marks it, ``contact`` nearer to the touching area of a curved
            object.
        rezero: Whether the untouched gel is learned anew a second after a release.
        noise_counts: Noise of the sensor's cells in blue, green and red, from :func:`tega.tactile.sensor_noise`;
            none takes that
            of a DIGIT. How much the sensor varies at rest is learned in any case.
        mm_per_px: Scale of a picture of 320 x 240 pixels, for ``area_mm2``; none leaves that out, and depth and
            force are nominal.
    """

    outline: Outline = "dent"
    rezero: bool = True
    noise_counts: tuple[NoiseCounts, NoiseCounts, NoiseCounts] | None = None
    mm_per_px: Annotated[float, msgspec.Meta(gt=0.001, lt=1.0)] | None = None


class LiveMetric(Metric):
    """Touch with a memory: :class:`tega.tactile.TouchTracker`, one for each finger."""

    summary: ClassVar[str] = "every contact in grades, without flicker; CCI rises with the press"
    memory: ClassVar[bool] = True
    version: ClassVar[int] = 2
    options_type: ClassVar[type[StageOptions]] = LiveOptions

    def __init__(self, setup: FingerSetup, options: LiveOptions) -> None:
        self._finger = setup.finger
        scale = options.mm_per_px
        light = None if scale is None else nominal_light()._replace(mm_per_px=scale)
        self._tracker = TouchTracker(
            setup.baseline,
            noise=options.noise_counts,
            light=light,
            outline=options.outline,
            rezero=options.rezero,
        )
        self._last_ns: int | None = None

    def update(self, frame: NDArray[np.uint8], t_ns: int) -> Contact:
        """Measure a frame."""
        # The first frame, and one whose time stands still or goes back, counts for one period.
        dt_s = None if self._last_ns is None or t_ns <= self._last_ns else (t_ns - self._last_ns) / 1e9
        self._last_ns = t_ns
        found = self._tracker.update(frame, dt_s=dt_s)
        x, y = found.centroid_xy
        return Contact(
            finger=self._finger,
            t_ns=t_ns,
            mass=found.mass,
            centroid_xy=found.centroid_xy,
            spread=found.spread,
            threshold=found.threshold,
            eda=found.eda,
            cci=found.cci,
            peak=found.peak,
            peak_xy=(round(x), round(y)) if found.in_contact else (0, 0),
            in_contact=found.in_contact,
            area_mm2=found.area_mm2,
            depth_mm=found.depth_mm,
            force_n=found.force_n,
            strength=found.strength,
            broad=found.broad,
        )

    def area(self, frame: NDArray[np.uint8]) -> NDArray[np.bool_]:  # noqa: ARG002  # the tracker remembers it
        """Return the outlined pixels."""
        return self._tracker.mask()
