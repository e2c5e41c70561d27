"""Measure how much a steady hold's area scatters from frame to frame, on pictures of another shading than the gel's.

Two models of light, both over a recorded picture of an untouched gel, and both with dents in closed form:

- ``slopes``: each colour brightens in proportion to the slope towards its own direction, added to the picture;
- ``lamps``: three small lamps beside the gel light it by Lambert's law with the square of the distance, plus a
  glint of the smooth skin (Blinn and Phong), and the picture is multiplied by what the dent makes of that.

Neither has the light field, the solver or the noise of :mod:`tega_sim.gel`. A dent comes with a DIGIT's noise: 2 s of
rest, down within a frame, held for 3 s, let go within a frame, and watched for half a second. The tables of
touch-live.md were made by this module of commit 49665fab.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Final, Literal, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from tega.tactile.tracker import GelLight, TouchTracker, nominal_light, sensor_noise

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


RATE_HZ: Final = 60.0
REST_S, HOLD_S, AFTER_S = 2.0, 3.0, 0.5
SETTLED_S: Final = 0.5
"""A hold counts as steady from so long after the press on."""
NOISE_COUNTS: Final = (3.17, 1.65, 2.74)
"""Standard deviation of a DIGIT's pixel: blue, green, red."""


class Case(NamedTuple):
    """One hold."""

    shape: OtherShape
    depth_mm: float
    light: Light
    background: str
    seed: int
    mains: float = 0.0
    """Amplitude of the lamp in the light, as a share."""
    lamp_hz: float = 100.0
    """How fast it flickers, but for mains that are 0.07 % fast."""


class Jitter(NamedTuple):
    """What the tracker reported of a hold; NaN where it did not report it."""

    reported: float
    """Share of the hold's frames from the second on that were reported."""
    area_scatter: float
    """Standard deviation of EDA over its mean while steady."""
    area_px: float


@cache
def backgrounds() -> dict[str, NDArray[np.uint8]]:
    """Return pictures of four DIGITs' untouched gels, BGR, by name; ``TEGA_DATA`` names the recordings' folder."""
    folder = Path(os.environ["TEGA_DATA"]) / "digit"
    presses = sorted((folder / "digit_ball_vocdex_a").glob("*.png"))
    found = {
        "D20641": cv2.imread(str(folder / "digit_ball_D20641" / "background.png")),
        "D20479": np.load(folder / "digit_backgrounds" / "ncf_bg_D20479.npy"),
        "tacto": cv2.imread(str(folder / "digit_backgrounds" / "tacto_bg_digit_240_320.jpg")),
        "vocdex": np.median([cv2.imread(str(file)) for file in presses], axis=0),
    }
    return {name: np.ascontiguousarray(image, np.uint8) for name, image in found.items()}


def _noise(rng: np.random.Generator, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Return a DIGIT's noise, of which neighbouring pixels share most."""
    noise = rng.standard_normal(shape, dtype=np.float32)
    # What four by four pixels share, and the rest.
    noise = 0.964 * 4.0 * cv2.blur(noise, (4, 4)) + 0.265 * noise
    return np.asarray(np.array(NOISE_COUNTS, np.float32) * noise, np.float32)


def measure(case: Case) -> Jitter:
    """Run a hold."""
    rng = np.random.default_rng(case.seed)
    still = backgrounds()[case.background]
    place = (float(rng.uniform(0.35, 0.65)), float(rng.uniform(0.35, 0.65)))
    dent = change_of_colour(case.light, still, dent_mm(case.shape, case.depth_mm, still.shape[:2], place))
    noises = [_noise(rng, still.shape).reshape(-1) for _ in range(8)]
    down = np.linspace(0.0, 1.0, still.shape[0], dtype=np.float32)[:, None, None]
    times = np.arange(round((REST_S + HOLD_S + AFTER_S) * RATE_HZ)) / RATE_HZ

    def picture(t_s: float, *, pressed: bool) -> NDArray[np.uint8]:
        light = still + dent if pressed else still.astype(np.float32)
        if case.mains:
            phase = 2 * np.pi * case.lamp_hz * (t_s * 1.0007 + 0.9 / RATE_HZ * down)
            light = light * (1.0 + case.mains * np.sin(phase)).astype(np.float32)
        noise = np.roll(noises[rng.integers(len(noises))], int(rng.integers(still.size)))
        taken: NDArray[np.uint8] = np.clip(np.rint(light + noise.reshape(still.shape)), 0, 255).astype(
            np.uint8
        )
        return taken

    first = [picture(-2.0 + k / RATE_HZ, pressed=False) for k in range(round(RATE_HZ))]
    nominal = nominal_light()
    tracker = TouchTracker(
        np.rint(np.mean(first, axis=0)).astype(np.uint8),
        rate_hz=RATE_HZ,
        noise=sensor_noise(first),
        light=GelLight(nominal.terms, nominal.mm_per_px, nominal.stiffness_n_mm3),
    )
    held = (times >= REST_S) & (times < REST_S + HOLD_S)
    contacts = [tracker.update(picture(t, pressed=bool(on))) for t, on in zip(times, held, strict=True)]
    on = np.array([contact.in_contact for contact in contacts])
    steady = held & (times >= REST_S + SETTLED_S) & on
    area = np.array([contact.eda for contact in contacts], np.float64)[steady]
    if not area.size:
        return Jitter(float(on[held][1:].mean()), float("nan"), float("nan"))
    return Jitter(float(on[held][1:].mean()), float(area.std() / area.mean()), float(area.mean()))
