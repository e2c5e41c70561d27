"""Shade dents as sensors that the project's own gel does not describe: for judging a touch reading on foreign pictures.

Two models of light, both over a recorded picture of an untouched gel, and both with dents in closed form:

- ``slopes``: each colour brightens in proportion to the slope towards its own direction, added to the picture;
- ``lamps``: three small lamps beside the gel light it by Lambert's law with the square of the distance, plus a
  glint of the smooth skin (Blinn and Phong), and the picture is multiplied by what the dent makes of that.

Neither has the light field, the solver or the noise of :mod:`tega_sim.gel`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

__all__ = ["Light", "OtherShape", "change_of_colour", "dent_mm"]

Light = Literal["slopes", "lamps"]
OtherShape = Literal["small ball", "large ball", "bar", "edge", "face"]
Height = NDArray[np.float32]

PX_PER_MM: Final = 17.5
# How far the skin is drawn down beside what presses it.
_SKIRT_MM: Final = 1.1
# Where the slopes of blue, green and red point, degrees, and their gains against each other.
_DIRECTIONS_DEG: Final = (74.0, 205.0, 318.0)
_GAINS: Final = (1.0, 0.62, 0.88)
# Lamps for blue, green and red: place (across, down, up), millimetres from the middle of the picture.
_LAMPS_MM: Final = ((-11.0, 8.0, 5.0), (12.0, 7.0, 6.0), (1.0, -14.0, 5.5))
_LEAK: Final = 0.12
"""Share of each lamp that the two other colours see."""
_GLINT: Final = 0.25
_GLOSS: Final = 12
_CAMERA_MM: Final = (0.0, 0.0, 25.0)


def dent_mm(
    shape: OtherShape, depth_mm: float, size: tuple[int, int], centre: tuple[float, float] = (0.5, 0.5)
) -> Height:
    """Return how deep each pixel is pressed in, float32 (H, W).

    ``shape``: balls of 3 and 8 mm radius, a bar of 2 mm radius and 8 mm length, an edge of 90 degrees turned
    by 30, a face of 7 x 9 mm with a rounded rim. ``depth_mm`` is the largest depth, ``size`` height and
    width, pixels, ``centre`` the middle of the dent, as shares of width and height.
    """
    rows, columns = (np.arange(n, dtype=np.float32) for n in size)
    x = (columns[None, :] - centre[0] * (size[1] - 1)) / PX_PER_MM
    y = (rows[:, None] - centre[1] * (size[0] - 1)) / PX_PER_MM
    if shape in ("small ball", "large ball"):
        radius_mm = 3.0 if shape == "small ball" else 8.0
        return _skirted(np.hypot(x, y), depth_mm, lambda r: r * r / (2 * radius_mm))
    if shape == "bar":
        off = np.hypot(np.maximum(np.abs(x) - 4.0, 0.0), y)
        return _skirted(off, depth_mm, lambda r: r * r / 4.0)
    if shape == "edge":
        turn = np.radians(30.0)
        off = np.hypot(
            np.cos(turn) * y - np.sin(turn) * x,
            0.35 * np.maximum(np.abs(np.cos(turn) * x + np.sin(turn) * y) - 2.5, 0),
        )
        return _skirted(off, depth_mm, lambda r: r)
    off = np.hypot(np.maximum(np.abs(x) - 3.5, 0.0), np.maximum(np.abs(y) - 4.5, 0.0))
    return _skirted(off, depth_mm, lambda r: 1.5 * r * r)


def _skirted(off_mm: Height, depth_mm: float, gap: Callable[[Height], Height]) -> Height:
    """Press to a depth what leaves a gap that grows with the distance; beyond it the skin dies away."""
    inside = depth_mm - gap(off_mm)
    rim = 0.45 * depth_mm
    reach = np.interp(rim, *_monotone(depth_mm, gap))
    outside = rim * np.exp(-np.maximum(off_mm - reach, 0.0) / _SKIRT_MM)
    return np.where(off_mm <= reach, np.maximum(inside, 0.0), outside).astype(np.float32)


def _monotone(depth_mm: float, gap: Callable[[Height], Height]) -> tuple[Height, Height]:
    """Return the depths that the gap leaves, rising, and the distances at which it does."""
    off = np.linspace(0.0, 12.0, 2400, dtype=np.float32)
    left = depth_mm - gap(off)
    return left[::-1], off[::-1]


def change_of_colour(light: Light, background: NDArray[np.uint8], height_mm: Height) -> NDArray[np.float32]:
    """Return what a dent adds to each pixel of an untouched picture, counts, float32 (H, W, 3), BGR.

    ``background`` is the untouched gel, uint8 (H, W, 3), ``height_mm`` the depth of the dent, float32 (H, W).
    """
    down, across = np.gradient(height_mm * PX_PER_MM)
    if light == "slopes":
        angles = np.radians(_DIRECTIONS_DEG)
        facing = [g * (np.cos(a) * across + np.sin(a) * down) for g, a in zip(_GAINS, angles, strict=True)]
        return (190.0 * np.stack(facing, axis=-1)).astype(np.float32)
    flat = _lit(np.zeros_like(down), np.zeros_like(across), np.zeros_like(height_mm))
    share = _lit(down, across, height_mm) / flat
    return (background * (share - 1.0)).astype(np.float32)


def _lit(down: Height, across: Height, height_mm: Height) -> NDArray[np.float64]:
    """Return the light that each colour of the camera receives, (H, W, 3)."""
    rows, columns = height_mm.shape
    x = (np.arange(columns)[None, :] - (columns - 1) / 2) / PX_PER_MM + np.zeros_like(height_mm)
    y = (np.arange(rows)[:, None] - (rows - 1) / 2) / PX_PER_MM + np.zeros_like(height_mm)
    place = np.stack([x, y, height_mm.astype(np.float64)], axis=-1)
    normal = _unit(np.stack([-across, -down, np.ones_like(across)], axis=-1).astype(np.float64))
    seen = _unit(np.array(_CAMERA_MM) - place)
    lamps = []
    for lamp in _LAMPS_MM:
        route = np.array(lamp) - place
        towards = _unit(route)
        diffuse = np.maximum((normal * towards).sum(axis=-1), 0.0)
        glint = np.maximum((normal * _unit(towards + seen)).sum(axis=-1), 0.0) ** _GLOSS
        lamps.append(150.0 * (diffuse + _GLINT * glint) / (route * route).sum(axis=-1))
    total = sum(lamps)
    return np.stack([0.15 + _LEAK * total + (1 - _LEAK) * own for own in lamps], axis=-1)


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return vectors of length 1."""
    scaled: NDArray[np.float64] = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return scaled
