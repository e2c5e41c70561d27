"""Find printed tags in a picture, to a small part of a pixel."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tega.runtime.opencv import load_cv2
from tega_scene.layout import Family

_DICTIONARIES: Final[dict[Family, str]] = {
    "apriltag-36h11": "DICT_APRILTAG_36h11",
    "apriltag-25h9": "DICT_APRILTAG_25h9",
    "apriltag-16h5": "DICT_APRILTAG_16h5",
    "aruco-4x4-50": "DICT_4X4_50",
    "aruco-5x5-100": "DICT_5X5_100",
}
# Of a side, from each end: there the border's corners round the edge off.
_END_SHARE: Final = 0.12
_REACHES_PX: Final = (4.0, 2.5, 2.0, 2.0)
"""How far to both sides of an edge to look, pass by pass: at the end no further than its own blur, so that the next
face of a box does not draw the edge towards it."""

_STEP_PX: Final = 0.25
_MOST_PX: Final = 2.5
_LEAST_CONTRAST: Final = 20.0
_SETTLED_PX: Final = 0.15
"""Largest movement of a corner in the last pass, pixels; a side that moves further follows another edge."""

_LEAST_MODULE_PX: Final = 3.0
"""Width of the black border below which a side is left alone: its two edges run into one another in the lens's blur,
which moved corners by half a pixel in rendered pictures of tags seen at a slant."""


def tag_dictionary(family: Family) -> Any:
    """Return OpenCV's dictionary of a family."""
    aruco = load_cv2("scene").aruco
    return aruco.getPredefinedDictionary(getattr(aruco, _DICTIONARIES[family]))


class TagFinder:
    """Finds tags of one family.

    OpenCV's detector finds and reads them. Each side is then measured again, where brightness changes most along
    lines across it, and a corner is the intersection of two sides. This uses whole sides of dozens of pixels instead
    of the few pixels about a corner.
    """

    def __init__(self, family: Family, wanted: frozenset[int]) -> None:
        self._cv2 = cv2 = load_cv2("scene")
        parameters = cv2.aruco.DetectorParameters()
        parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        parameters.cornerRefinementWinSize = 4
        parameters.adaptiveThreshWinSizeMin = 7
        parameters.adaptiveThreshWinSizeMax = 31
        parameters.adaptiveThreshWinSizeStep = 12
        parameters.minMarkerPerimeterRate = 0.015
        self._detector = cv2.aruco.ArucoDetector(tag_dictionary(family), parameters)
        self._wanted = wanted
        self._modules = tag_dictionary(family).markerSize + 2

    def find(
        self, image: NDArray[np.uint8], *, within: tuple[int, int, int, int] | None = None
    ) -> dict[int, NDArray[np.float64]]:
        """Return each tag's corners by number.

        They are float64 (4, 2), pixels across and down: upper left, upper right, lower right, lower left.
        ``image`` is uint8 (H, W) or (H, W, 3); ``within`` the part to look at: left, top, right, bottom,
        pixels; ``None``: all of it.
        """
        grey = image if image.ndim == 2 else self._cv2.cvtColor(image, self._cv2.COLOR_BGR2GRAY)
        left, top, right, bottom = within or (0, 0, grey.shape[1], grey.shape[0])
        tags: dict[int, NDArray[np.float64]] = {}
        twice: set[int] = set()
        for number, corners in self.candidates(np.ascontiguousarray(grey[top:bottom, left:right])):
            if number in tags:
                twice.add(number)  # one of the two is a reflection, or another print: neither can be trusted
            refined = self.refined(grey, corners + np.array([left, top]))
            if refined is not None and _module_px(refined, self._modules) >= _LEAST_MODULE_PX:
                tags[number] = refined
        return {number: corners for number, corners in tags.items() if number not in twice}

    def candidates(self, grey: NDArray[np.uint8]) -> list[tuple[int, NDArray[np.float64]]]:
        """Return numbers and corners of the wanted tags as OpenCV's detector has them; one may be there twice."""
        found, numbers, _ = self._detector.detectMarkers(grey)
        if numbers is None:
            return []
        return [
            (number, np.asarray(corners, np.float64).reshape(4, 2))
            for corners, number in zip(found, np.asarray(numbers).ravel().tolist(), strict=True)
            if number in self._wanted
        ]

    def refined(self, grey: NDArray[np.uint8], corners: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return corners at the intersections of the re-measured sides; ``None`` if a side does not settle."""
        before = now = corners
        for reach_px in _REACHES_PX:
            if (further := self._refined(grey, now, reach_px)) is None:
                return None
            before, now = now, further
        return None if np.abs(now - before).max() > _SETTLED_PX else now

    def _refined(
        self, grey: NDArray[np.uint8], corners: NDArray[np.float64], reach_px: float
    ) -> NDArray[np.float64] | None:
        """Return where the fitted sides meet; ``None`` where a side cannot be fitted, or leads far away."""
        lines = []
        for k in range(4):
            if (line := self._side(grey, corners[k], corners[(k + 1) % 4], reach_px)) is None:
                return None
            lines.append(line)
        met = np.empty((4, 2))
        for k in range(4):
            (n1, c1), (n2, c2) = lines[k - 1], lines[k]
            matrix = np.array([n1, n2])
            if abs(np.linalg.det(matrix)) < 0.1:
                return None
            met[k] = np.linalg.solve(matrix, [c1, c2])
        return met if np.abs(met - corners).max() < _MOST_PX else None

    def _side(
        self, grey: NDArray[np.uint8], a: NDArray[np.float64], b: NDArray[np.float64], reach_px: float
    ) -> tuple[NDArray[np.float64], float] | None:
        """Fit a line to the edge between two corners: its normal n and n·p; ``None`` where there is no clear one."""
        along = b - a
        length = float(np.hypot(*along))
        if length < 12:
            return None
        along /= length
        out = np.array([along[1], -along[0]])  # corners go clockwise as one looks: this points out of the tag
        shares = np.linspace(_END_SHARE, 1 - _END_SHARE, max(6, min(int(length), 48)))
        reach = min(reach_px, max(1.5, length / 16))
        offsets = np.arange(-reach, reach + _STEP_PX / 2, _STEP_PX)
        on = a + shares[:, None] * (b - a)
        places = on[:, None, :] + offsets[None, :, None] * out
        profile = _bilinear(grey, places)
        if profile is None:
            return None
        slope = np.clip(np.diff(profile, axis=1), 0, None)  # dark inside, light outside
        weight = slope.sum(1)
        if _median(weight) < _LEAST_CONTRAST:
            return None
        slope = np.where(slope > 0.15 * slope.max(1, keepdims=True), slope, 0)
        middles = (offsets[1:] + offsets[:-1]) / 2
        offset = (slope @ middles) / np.maximum(slope.sum(1), 1e-9)
        good = weight > 0.5 * _median(weight)
        for _ in range(3):
            if good.sum() < 5:
                return None
            x, y = shares[good], offset[good]
            x_mean, y_mean = x.mean(), y.mean()
            rise = ((x - x_mean) @ (y - y_mean)) / ((x - x_mean) @ (x - x_mean))
            left = np.abs(offset - y_mean - rise * (shares - x_mean))
            good &= left < max(0.1, 3 * _median(left[good]))
        p = a + (y_mean - rise * x_mean) * out
        q = b + (y_mean + rise * (1 - x_mean)) * out
        direction = (q - p) / np.hypot(*(q - p))
        normal = np.array([direction[1], -direction[0]])
        return normal, float(normal @ p)


def _median(values: NDArray[np.float64]) -> float:
    """Return the upper median; of few numbers, in a tenth of NumPy's time."""
    return float(np.sort(values)[len(values) // 2])


def _module_px(corners: NDArray[np.float64], modules: int) -> float:
    (x1, y1), (x2, y2) = corners[2] - corners[0], corners[3] - corners[1]
    longest = max(float(np.hypot(*(corners[k] - corners[k - 1]))) for k in range(4))
    return float(abs(x1 * y2 - x2 * y1)) / 2 / longest / modules


def _bilinear(grey: NDArray[np.uint8], places: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return brightness at places, float64 of their shape; ``None`` where one is outside."""
    x, y = places[..., 0], places[..., 1]
    height, width = grey.shape
    if x.min() < 0 or y.min() < 0 or x.max() >= width - 1 or y.max() >= height - 1:
        return None
    i, j = y.astype(np.intp), x.astype(np.intp)
    v, u = y - i, x - j
    upper = grey[i, j] * (1 - u) + grey[i, j + 1] * u
    lower = grey[i + 1, j] * (1 - u) + grey[i + 1, j + 1] * u
    blended: NDArray[np.float64] = upper * (1 - v) + lower * v
    return blended
