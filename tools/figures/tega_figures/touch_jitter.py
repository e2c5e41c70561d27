"""Measure how much a steady hold's area scatters from frame to frame, with and without bands of mains light.

A dent of another shading than the simulated gel's (:mod:`tega_figures.other_gels`) is pressed on a recorded picture of
an untouched gel with a DIGIT's noise: 2 s of rest, down within a frame, held for 3 s, let go within a frame, and
watched for half a second.
"""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path
from typing import Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from tega.tactile.tracker import GelLight, TouchTracker, nominal_light, sensor_noise
from tega_figures.other_gels import Light, OtherShape, change_of_colour, dent_mm

__all__ = ["Case", "Jitter", "measure"]

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
    """Mean of EDA in that time."""


@cache
def _backgrounds() -> dict[str, NDArray[np.uint8]]:
    """Return pictures of three DIGITs' untouched gels, BGR, by name."""
    folder = Path(os.environ["TEGA_DATA"]) / "digit"
    presses = sorted((folder / "digit_ball_vocdex_a").glob("*.png"))
    found = {
        "D20641": cv2.imread(str(folder / "digit_ball_D20641" / "background.png")),
        "tacto": cv2.imread(str(folder / "digit_backgrounds" / "tacto_bg_digit_240_320.jpg")),
        "vocdex": np.median([cv2.imread(str(file)) for file in presses], axis=0),
    }
    return {name: np.ascontiguousarray(image, np.uint8) for name, image in found.items()}


def _noise(rng: np.random.Generator, shape: tuple[int, ...]) -> NDArray[np.float32]:
    noise = rng.standard_normal(shape, dtype=np.float32)
    # What four by four pixels share, and the rest.
    noise = 0.964 * 4.0 * cv2.blur(noise, (4, 4)) + 0.265 * noise
    return np.asarray(np.array(NOISE_COUNTS, np.float32) * noise, np.float32)


def measure(case: Case) -> Jitter:
    """Run a hold."""
    rng = np.random.default_rng(case.seed)
    still = _backgrounds()[case.background]
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
    nan = float("nan")
    return Jitter(
        float(on[held][1:].mean()),
        float(area.std() / area.mean()) if area.size else nan,
        float(area.mean()) if area.size else nan,
    )
