"""The ways to compute contact metrics that TEGA ships, and what every way has in common."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from functools import partial
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.tactile import ContactMetrics, contact_metrics, read_contact

__all__ = [
    "CONTACT_LAWS",
    "FLOOR",
    "NUMPY_FLOOR",
    "ContactKernel",
    "Law",
    "Metrics",
    "floor_kernels",
    "law_kernel",
    "preset_kernel",
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
    compare = _c_library().memcmp
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


def _c_library() -> Any:
    return ctypes.cdll.msvcrt if sys.platform == "win32" else ctypes.CDLL(None)


def _as_words(image: NDArray[np.uint8]) -> NDArray[np.uint64]:
    flat = image.reshape(-1)
    return flat[: flat.size // 8 * 8].view(np.uint64)
