"""The same equations as others would write them: OpenCV, NumPy, Numba.

Each is written to be fast in its library's terms, with buffers made once. The spread, threshold, area and index are
computed from whatever the library's sums are; where those are rounded, so is the answer.
"""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec
from math import floor, nan, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tega_figures.bench.variants import ContactKernel, Law, Metrics

__all__ = ["MAKERS", "NONE", "contact_peers", "finish", "moments_to_sigma"]

# Mass, centroid (x, y) and variance of a map.
_Sums = tuple[float, float, float, float]

WEIGHTS_BGR = (0.114, 0.587, 0.299)
FACTOR = 1.28
NONE = Metrics((nan, nan), nan, 0, 0.0)


def contact_peers(law: Law, size: tuple[int, int]) -> dict[str, ContactKernel]:
    """Return the peers, by name, that can compute a law with what is installed.

    All peers read the map at the nearest pixel. ``size`` is height and width of the images.
    """
    return {name: make(law, size) for name, (needs, make) in MAKERS.items() if find_spec(needs) is not None}


def moments_to_sigma(second: float, mass: float, mu_x: float, mu_y: float) -> float:
    """Return Eq 3 from raw moments, NaN where the variance is negative."""
    variance = second / mass - mu_x * mu_x - mu_y * mu_y
    return sqrt(variance) if variance >= 0 else nan


def nearest(mu: float, side: int) -> int:
    """Return the pixel nearest to a coordinate, inside the image."""
    return min(max(floor(mu + 0.5), 0), side - 1)


def finish(mu_x: float, mu_y: float, sigma: float, eda: int, peak: float) -> Metrics:
    """Put an answer together (Eq 6)."""
    return Metrics((mu_x, mu_y), sigma, eda, peak / eda if eda else 0.0)


def opencv_8_bit(law: Law, size: tuple[int, int]) -> ContactKernel:
    """Return OpenCV's usual way: grey in 8 bits, which rounds every pixel."""
    import cv2

    height, width = size
    change = np.empty((height, width, 3), np.uint8)
    grey = np.empty(size, np.uint8)
    grey_baseline = np.empty(size, np.uint8)
    map_16 = np.empty(size, np.int16)
    above = np.empty(size, np.uint8)
    to_grey = cv2.COLOR_BGR2GRAY

    def opencv(frame: NDArray[np.uint8], baseline: NDArray[np.uint8]) -> Metrics:
        grey_map: Any
        minus = None
        if law.difference == "signed":
            cv2.cvtColor(frame, to_grey, dst=grey)
            cv2.cvtColor(baseline, to_grey, dst=grey_baseline)
            grey_map, minus = cv2.subtract(grey, grey_baseline, dst=map_16, dtype=cv2.CV_16S), grey_baseline
        else:
            subtract = cv2.subtract if law.difference == "rectified" else cv2.absdiff
            subtract(frame, baseline, dst=change)
            grey_map = cv2.cvtColor(change, to_grey, dst=grey)
        return _opencv_rest(cv2, grey_map, _sums_8_bit(cv2, grey, minus), law, above)

    return opencv


def opencv_float32(law: Law, size: tuple[int, int]) -> ContactKernel:
    """Return OpenCV with the map in single precision."""
    import cv2

    height, width = size
    change_8 = np.empty((height, width, 3), np.uint8)
    change = np.empty((height, width, 3), np.float32)
    grey = np.empty(size, np.float32)
    above = np.empty(size, np.uint8)
    weights = np.array([WEIGHTS_BGR], np.float32)

    def opencv(frame: NDArray[np.uint8], baseline: NDArray[np.uint8]) -> Metrics:
        if law.difference == "signed":
            cv2.subtract(frame, baseline, dst=change, dtype=cv2.CV_32F)
        else:
            subtract = cv2.subtract if law.difference == "rectified" else cv2.absdiff
            subtract(frame, baseline, dst=change_8)
            np.copyto(change, change_8)
        cv2.transform(change, weights, dst=grey)
        return _opencv_rest(cv2, grey, _moments(cv2, grey), law, above)

    return opencv


def _opencv_rest(cv2: Any, grey: Any, sums: _Sums, law: Law, above: Any) -> Metrics:
    height, width = grey.shape
    mass, mu_x, mu_y, variance = sums
    if mass <= 0:
        return NONE
    root = sqrt(variance) if variance >= 0 else nan
    sigma = root if law.spread == "spatial" else cv2.meanStdDev(grey)[1][0, 0]
    threshold = float(grey[nearest(mu_y, height), nearest(mu_x, width)]) - FACTOR * sigma
    _, peak, _, _ = cv2.minMaxLoc(grey)
    eda = cv2.countNonZero(cv2.compare(grey, threshold, cv2.CMP_GT, dst=above))
    return finish(mu_x, mu_y, sigma, eda, peak)


def _moments(cv2: Any, grey: Any) -> _Sums:
    """Return mass, centroid and variance of a map in single precision, which ``cv2.moments`` is fastest for."""
    moments = cv2.moments(grey)
    mass = moments["m00"]
    if mass <= 0:
        return 0.0, 0.0, 0.0, 0.0
    # Central moments, so that nothing cancels here.
    return mass, moments["m10"] / mass, moments["m01"] / mass, (moments["mu20"] + moments["mu02"]) / mass


def _sums_8_bit(cv2: Any, grey: Any, minus: Any = None) -> _Sums:
    """Return the same of a map of bytes, or of two maps' difference, from the sums of its columns and its rows."""
    columns, rows = (cv2.reduce(grey, dim, cv2.REDUCE_SUM, dtype=cv2.CV_32S).ravel() for dim in (0, 1))
    if minus is not None:
        columns = columns - cv2.reduce(minus, 0, cv2.REDUCE_SUM, dtype=cv2.CV_32S).ravel()
        rows = rows - cv2.reduce(minus, 1, cv2.REDUCE_SUM, dtype=cv2.CV_32S).ravel()
    mass = float(rows.sum())
    if mass <= 0:
        return 0.0, 0.0, 0.0, 0.0
    x, y = _from_middle(columns.size), _from_middle(rows.size)
    mu_x, mu_y = float(columns @ x) / mass, float(rows @ y) / mass
    variance = (float(columns @ (x * x)) + float(rows @ (y * y))) / mass - mu_x * mu_x - mu_y * mu_y
    return mass, mu_x + (columns.size - 1) / 2, mu_y + (rows.size - 1) / 2, variance


@cache
def _from_middle(n: int) -> NDArray[np.float64]:
    return np.arange(n, dtype=np.float64) - (n - 1) / 2


def numpy_tuned(law: Law, size: tuple[int, int]) -> ContactKernel:
    """Return NumPy with buffers, narrow types and matrix products."""
    height, width = size
    change_8, lower = np.empty((2, height, width, 3), np.uint8)
    change_16 = np.empty((height, width, 3), np.int16)
    change = np.empty((height, width, 3), np.float32)
    grey = np.empty(height * width, np.float32)
    above = np.empty(size, np.bool_)
    weights = np.array(WEIGHTS_BGR, np.float32)
    # Coordinates from the middle: smaller powers lose fewer digits.
    x, y = np.arange(width) - (width - 1) / 2, np.arange(height) - (height - 1) / 2
    powers_x = np.stack([np.ones_like(x), x, x * x]).astype(np.float32)
    powers_y = np.stack([np.ones_like(y), y, y * y]).astype(np.float32)

    def tuned(frame: NDArray[np.uint8], baseline: NDArray[np.uint8]) -> Metrics:
        if law.difference == "signed":
            np.copyto(change, np.subtract(frame, baseline, out=change_16, dtype=np.int16))
        else:
            # Both fit bytes, sixteen and more to an instruction.
            np.maximum(frame, baseline, out=change_8)
            if law.difference == "absolute":
                np.minimum(frame, baseline, out=lower)
            np.subtract(change_8, baseline if law.difference == "rectified" else lower, out=change_8)
            np.copyto(change, change_8)
        np.dot(change.reshape(-1, 3), weights, out=grey)
        levels = grey.reshape(size)
        sums = ((powers_y @ levels) @ powers_x.T).tolist()
        mass = sums[0][0]
        if mass <= 0:
            return NONE
        mu_x, mu_y = sums[0][1] / mass, sums[1][0] / mass
        if law.spread == "spatial":
            sigma = moments_to_sigma(sums[0][2] + sums[2][0], mass, mu_x, mu_y)
        else:
            mean = mass / grey.size
            sigma = sqrt(max(float(grey @ grey) / grey.size - mean * mean, 0.0))
        mu_x, mu_y = mu_x + (width - 1) / 2, mu_y + (height - 1) / 2
        threshold = float(levels[nearest(mu_y, height), nearest(mu_x, width)]) - FACTOR * sigma
        eda = int(np.count_nonzero(np.greater(levels, threshold, out=above)))
        return finish(mu_x, mu_y, sigma, eda, float(grey.max()))

    return tuned


def numpy_as_printed(law: Law, size: tuple[int, int]) -> ContactKernel:  # noqa: ARG001  # every maker is called alike
    """Return NumPy line by line as the equations read, in double precision."""

    def printed(frame: NDArray[np.uint8], baseline: NDArray[np.uint8]) -> Metrics:
        change = frame.astype(np.float64) - baseline
        if law.difference == "rectified":
            change = np.maximum(change, 0)
        elif law.difference == "absolute":
            change = np.abs(change)
        grey = 0.299 * change[..., 2] + 0.587 * change[..., 1] + 0.114 * change[..., 0]
        y, x = np.mgrid[: grey.shape[0], : grey.shape[1]]
        mass = grey.sum()
        if mass <= 0:
            return NONE
        mu_x, mu_y = float((x * grey).sum() / mass), float((y * grey).sum() / mass)
        if law.spread == "spatial":
            variance = (((x - mu_x) ** 2 + (y - mu_y) ** 2) * grey).sum() / mass
            sigma = sqrt(variance) if variance >= 0 else nan
        else:
            sigma = float(grey.std())
        height, width = grey.shape
        threshold = grey[nearest(mu_y, height), nearest(mu_x, width)] - FACTOR * sigma
        eda = int((grey > threshold).sum())
        return finish(mu_x, mu_y, sigma, eda, float(grey.max()))

    return printed


def numba_fused(law: Law, size: tuple[int, int]) -> ContactKernel:  # noqa: ARG001  # every maker is called alike
    """Return two loops over the pixels, compiled: sums and peak, then the count."""
    from tega_figures.bench.compiled import contact_loops

    sum_up, count = contact_loops()
    mode = {"signed": 0, "rectified": 1, "absolute": 2}[law.difference]

    def fused(frame: NDArray[np.uint8], baseline: NDArray[np.uint8]) -> Metrics:
        height, width, _ = frame.shape
        mass, first_x, first_y, second, squares, peak = sum_up(frame, baseline, mode)
        if mass <= 0:
            return NONE
        mu_x, mu_y = first_x / mass, first_y / mass
        if law.spread == "spatial":
            sigma = moments_to_sigma(second, mass, mu_x, mu_y)
        else:
            n, mean = height * width, mass / (height * width)
            sigma = sqrt(max(squares / n - mean * mean, 0.0))
        row, column = nearest(mu_y, height), nearest(mu_x, width)
        eda = count(frame, baseline, mode, (row, column), FACTOR * sigma)
        return finish(mu_x, mu_y, sigma, eda, peak)

    return fused


# By name: the package it needs, and what makes it.
MAKERS = {
    "OpenCV, 8-bit grey": ("cv2", opencv_8_bit),
    "OpenCV, float32": ("cv2", opencv_float32),
    "NumPy, tuned": ("numpy", numpy_tuned),
    "Numba, fused": ("numba", numba_fused),
    "NumPy, as printed": ("numpy", numpy_as_printed),
}
