"""The ways to compute contact metrics that TEGA ships, what every way has in common, and how far it is from exact."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from fractions import Fraction
from functools import partial
from math import hypot, isnan
from typing import Final, Literal, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.tactile import ContactMetrics, contact_metrics, read_contact
from tega_figures.exact import ExactContact

__all__ = [
    "CONTACT_LAWS",
    "FLOOR",
    "NUMPY_FLOOR",
    "ContactError",
    "ContactKernel",
    "Law",
    "Metrics",
    "floor_kernels",
    "law_kernel",
    "measure_error",
    "preset_kernel",
    "worst",
]

FLOOR: Final = "both images read once"
NUMPY_FLOOR: Final = "both images read once, NumPy"

Difference = Literal["signed", "rectified", "absolute"]
Spread = Literal["spatial", "intensity"]


class Law(NamedTuple):
    """How the equations are read: difference of frame and baseline, σ, and the map at the centroid."""

    difference: Difference
    spread: Spread
    centroid_value: Literal["nearest", "bilinear"] = "nearest"

    @property
    def name(self) -> str:
        """For tables."""
        tail = ", bilinear" if self.centroid_value == "bilinear" else ""
        return f"{self.difference}, {self.spread}{tail}"


class Metrics(NamedTuple):
    """The numbers that are compared: Eq 2, 3, 5 and 6."""

    centroid_xy: tuple[float, float]
    spread: float
    eda: int
    cci: float


Images = tuple[NDArray[np.uint8], NDArray[np.uint8]]
ContactKernel = Callable[[NDArray[np.uint8], NDArray[np.uint8]], Metrics | ContactMetrics]

CONTACT_LAWS = (
    Law("rectified", "spatial"),
    Law("signed", "spatial"),
    Law("absolute", "spatial"),
    Law("rectified", "intensity"),
    Law("signed", "intensity"),
    Law("absolute", "intensity"),
)


def law_kernel(law: Law) -> ContactKernel:
    """Return `tega.tactile.contact_metrics` under a law."""
    difference, spread, centroid_value = law
    return partial(contact_metrics, difference=difference, spread=spread, centroid_value=centroid_value)


def preset_kernel(reading: Literal["paper", "live"]) -> ContactKernel:
    """Return `tega.tactile.read_contact` with a preset."""
    return partial(read_contact, reading=reading)


def floor_kernels(images: Images) -> dict[str, Callable[[], object]]:
    """Return the least that any exact way must do: read as many bytes as both images have, once.

    The first is the floor: ``memcmp`` of the C library, written by hand for the processor, of an image and its copy.
    The other is NumPy's fastest reduction.
    """
    frame, baseline = images
    copy = frame.copy()
    compare = (ctypes.cdll.msvcrt if sys.platform == "win32" else ctypes.CDLL(None)).memcmp
    compare.argtypes, compare.restype = (ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t), ctypes.c_int
    at, its, n_bytes = frame.ctypes.data, copy.ctypes.data, frame.nbytes
    words = [_as_words(image) for image in (frame, baseline)]
    reduce = np.bitwise_or.reduce

    def read_once() -> object:
        _alive = frame, copy
        return compare(at, its, n_bytes)

    def read_by_numpy() -> object:
        return reduce(words[0]) | reduce(words[1])

    return {FLOOR: read_once, NUMPY_FLOOR: read_by_numpy}


def _as_words(image: NDArray[np.uint8]) -> NDArray[np.uint64]:
    flat = image.reshape(-1)
    return flat[: flat.size // 8 * 8].view(np.uint64)


class ContactError(msgspec.Struct, frozen=True, kw_only=True):
    """How far a variant's numbers lie from the exact ones.

    ``centroid_px`` is the distance between the centroids, ``spread_relative`` is of σ, ``eda_pixels`` the
    difference in the number of pixels.
    """

    centroid_px: float
    spread_relative: float
    eda_pixels: float
    cci_relative: float


def measure_error(metrics: Metrics | ContactMetrics, truth: ExactContact) -> ContactError | None:
    """Compare a variant's answer with the exact one, whose spread and CCI are not zero.

    The differences are taken between fractions and rounded only then. ``None`` where the variant has no
    answer; :class:`ValueError` where the equations have no value on this frame.
    """
    if truth.centroid_xy is None or truth.spread is None:
        raise ValueError("the equations have no value on this frame")
    if any(isnan(n) for n in (*metrics.centroid_xy, metrics.spread, metrics.cci)):
        return None
    dx, dy = (
        float(Fraction(own) - its) for own, its in zip(metrics.centroid_xy, truth.centroid_xy, strict=True)
    )
    return ContactError(
        centroid_px=hypot(dx, dy),
        spread_relative=_relative(metrics.spread, Fraction(truth.spread)),
        eda_pixels=float(abs(metrics.eda - truth.eda)),
        cci_relative=_relative(metrics.cci, truth.cci),
    )


def _relative(own: float, truth: Fraction) -> float:
    return float(abs(Fraction(own) - truth) / truth)


def worst(errors: list[ContactError | None]) -> ContactError | None:
    """Return the largest error of each number; ``None`` where there was no answer once."""
    known = [error for error in errors if error is not None]
    if len(known) < len(errors):
        return None
    return ContactError(
        centroid_px=max(e.centroid_px for e in known),
        spread_relative=max(e.spread_relative for e in known),
        eda_pixels=max(e.eda_pixels for e in known),
        cci_relative=max(e.cci_relative for e in known),
    )
