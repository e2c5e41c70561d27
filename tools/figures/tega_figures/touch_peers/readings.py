"""Touch readings that are compared: the tracker, the stateless ``live``, and others' ways."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from tega.tactile import contact_mask, read_contact
from tega.tactile.tracker import TouchTracker, TrackedContact, sensor_noise

__all__ = [
    "MOG2",
    "PROJECT",
    "THRESHOLD",
    "Image",
    "Makes",
    "PeerReading",
    "Reading",
    "Unit",
    "makers",
    "pytouch_area",
]

PROJECT: Final = Path(__file__).resolve().parents[4]
# Threads of its own do not help on pictures of this size.
cv2.setNumThreads(1)
Image = NDArray[np.uint8]
Mask = NDArray[np.bool_]
THRESHOLD: Final = "threshold of 15 counts"
MOG2: Final = "OpenCV MOG2"
# What counts as contact for a reading that only marks pixels.
LEAST_SHARE: Final = 0.01


class PeerReading(NamedTuple):
    """What a reading says of one frame."""

    on: bool
    area_px: float
    peak: float
    mask: Mask
    force_n: float = float("nan")
    contact: TrackedContact | None = None


@dataclass(frozen=True, eq=False)
class Unit:
    """What a reading may know of a sensor before the first frame."""

    still: Sequence[Image] | NDArray[np.uint8]
    """Frames of the untouched gel."""
    rate_hz: float
    noise_frames: Sequence[Image] | NDArray[np.uint8] | None = None
    """Frames that its noise can be measured on, where there are any."""

    @cached_property
    def baseline(self) -> Image:
        """The median of the untouched frames."""
        middle: Image = np.median(np.array(self.still), axis=0).astype(np.uint8)
        return middle

    @cached_property
    def noise(self) -> tuple[float, float, float] | None:
        """The measured noise."""
        return None if self.noise_frames is None else sensor_noise(self.noise_frames)


Reading = Callable[..., PeerReading]
"""Is given the next frame and ``dt_s``, the time since the one before, seconds, or None for one period."""
Makes = Callable[[Unit], Reading]


def tracker(unit: Unit) -> Reading:
    """The ``live`` tracker, with the sensor's noise where that can be measured."""
    followed = TouchTracker(unit.baseline, rate_hz=unit.rate_hz, noise=unit.noise)

    def read(frame: Image, dt_s: float | None = None) -> PeerReading:
        c = followed.update(frame, dt_s=dt_s)
        return PeerReading(c.in_contact, c.eda, c.peak, followed.mask(), c.force_n, c)

    return read


WITH_MEMORY: Final[list[Makes]] = [tracker]
"""Readings that are shown a single picture for a second."""


def stateless(unit: Unit) -> Reading:
    """The ``live`` reading of one picture."""
    baseline, noise = unit.baseline, unit.noise

    def read(frame: Image, dt_s: float | None = None) -> PeerReading:  # noqa: ARG001
        m = read_contact(frame, baseline, noise=noise)
        return PeerReading(m.in_contact, m.eda, m.peak, contact_mask(frame, baseline, noise=noise))

    return read


def threshold(unit: Unit) -> Reading:
    """Pixels whose largest difference over the colours exceeds 15 counts; a contact is 1 % of the picture."""
    still = unit.baseline

    def read(frame: Image, dt_s: float | None = None) -> PeerReading:  # noqa: ARG001
        blue, green, red = cv2.split(cv2.absdiff(frame, still))
        difference = cv2.max(cv2.max(blue, green), red)
        mask = difference > 15
        counts = np.cumsum(np.bincount(difference.reshape(-1), minlength=256))
        strongest = int(
            np.searchsorted(counts, 0.995 * difference.size)
        )  # peak: what 0.5 % of the pixels exceed
        return PeerReading(bool(mask.mean() > LEAST_SHARE), int(mask.sum()), float(strongest), mask)

    return read


def subtraction(var_threshold: float, rate: float) -> Makes:
    """Return OpenCV's background subtraction in one of its ways.

    Args:
        var_threshold: Squared distance from the background, in its variance, from which a pixel is foreground.
        rate: Learning rate after the untouched frames; 0 keeps what was learned from them.
    """
    kernel = np.ones((5, 5), np.uint8)  # specks of noise go

    def make(unit: Unit) -> Reading:
        model = cv2.createBackgroundSubtractorMOG2(varThreshold=var_threshold, detectShadows=False)
        for frame in unit.still:
            model.apply(frame)

        def read(frame: Image, dt_s: float | None = None) -> PeerReading:  # noqa: ARG001
            mask = cv2.morphologyEx(model.apply(frame, learningRate=rate), cv2.MORPH_OPEN, kernel) > 0
            area = int(mask.sum())
            return PeerReading(bool(mask.mean() > LEAST_SHARE), area, float(area), mask)

        return read

    return make


_WAYS: Final = {
    f"{MOG2}, threshold {v:g}, rate {rate:g}": subtraction(v, rate)
    for v, rate in ((16.0, 0.0), (50.0, 0.0), (150.0, 0.0), (50.0, 0.002))
}


SEES_ALL: Final[list[Makes]] = [_WAYS[name] for name in _WAYS if not name.endswith("rate 0")]
"""Readings that learn from every frame, so that none may be left out."""


def pytouch_area() -> tuple[Makes | None, str]:
    """Return PyTouch's contact area and a line that says how it came here, or ``None`` and why it did not.

    The package as a whole cannot be installed: it asks for pytorch3d, which has no wheel. Its area needs OpenCV alone.
    """
    site = PROJECT / "target" / "peers" / "pytouch"
    file = site / "pytouch" / "tasks" / "contact_area.py"
    if not file.is_file():
        pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", str(site)]
        done = subprocess.run([*pip, "pytouch==0.4.2"], check=False, capture_output=True, text=True)
        if done.returncode or not file.is_file():
            return None, f"PyTouch 0.4.2 does not install: {done.stderr.strip().splitlines()[-1:]}"
    found = importlib.util.spec_from_file_location("pytouch_contact_area", file)
    assert found is not None
    assert found.loader is not None
    module: Any = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    area = module.ContactArea(draw_poly=False)

    def make(unit: Unit) -> Reading:
        baseline = unit.baseline

        def read(frame: Image, dt_s: float | None = None) -> PeerReading:  # noqa: ARG001
            mask = np.zeros(frame.shape[:2], np.uint8)
            try:
                (a, b), (c, d) = area(frame, base=baseline)
            except UnboundLocalError:  # what it says where no contour is long enough
                return PeerReading(on=False, area_px=0, peak=0.0, mask=mask > 0)
            centre, major, minor = (a + b) / 2, a - b, c - d
            axes = (float(np.hypot(*major)) / 2, float(np.hypot(*minor)) / 2)
            turn = float(np.degrees(np.arctan2(major[1], major[0])))
            cv2.ellipse(mask, (tuple(map(float, centre)), (2 * axes[0], 2 * axes[1]), turn), 1, -1)
            on = int(mask.sum())
            return PeerReading(on > 0, on, float(on), mask > 0)

        return read

    message = (
        "PyTouch 0.4.2 as a whole does not install (it asks for pytorch3d, which has no wheel); its `ContactArea` "
        "needs OpenCV alone and is loaded from the published wheel, with its own thresholds."
    )
    return make, message


def makers(pytouch: Makes | None) -> dict[str, Makes]:
    """Return every reading by its name; those of background subtraction have a name each."""
    named: dict[str, Makes] = {"live tracker": tracker, "live, one picture": stateless}
    named[THRESHOLD] = threshold
    if pytouch is not None:
        named["PyTouch area"] = pytouch
    return named | _WAYS
