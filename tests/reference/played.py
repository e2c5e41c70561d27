"""Fingers and muscles that need no device: made-up pictures and samples of one grasp, played from files."""

from __future__ import annotations

import functools
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

TOUCH_HZ, EMG_HZ = 60, 1000
# The grasp by shares of its duration: rest, a firm hold, a firmer one, rest.
_SHARES = (0.0, 0.25, 0.4, 0.5, 0.6, 0.75, 0.85, 1.0)
_EFFORT = (0.0, 0.0, 0.5, 0.5, 1.0, 0.9, 0.0, 0.0)


@functools.cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="tega-played-")


def _effort(n: int) -> NDArray[np.float64]:
    return np.interp(np.arange(n) / n, _SHARES, _EFFORT)


def _pressed(depths: NDArray[np.float64], seed: int, shape: tuple[int, int]) -> NDArray[np.uint8]:
    """Return pictures of a gel under slanting light, with a round dent of so many grey values, and a little noise."""
    height, width = shape
    y, x = np.mgrid[:height, :width]
    light = 90.0 + 30 * x / width + 20 * y / height + seed
    dent = np.exp(-((y - height / 2) ** 2 + (x - width / 2) ** 2) / (2 * (0.15 * height) ** 2))
    # In spots of eight by eight pixels, as noise of each pixel makes a lossless recording 3.5 times the size.
    spots = np.random.default_rng(seed).integers(
        -1, 2, (len(depths), -(-height // 8), -(-width // 8), 3), np.int8
    )
    flicker = spots.repeat(8, axis=1).repeat(8, axis=2)[:, :height, :width]
    pictures = np.empty(flicker.shape, np.uint8)
    for picture, depth, noise in zip(pictures, depths, flicker, strict=True):
        picture[:] = np.clip(
            np.rint(light[..., None] + depth * dent[..., None] * (1.0, 0.8, 0.6)) + noise, 0, 255
        )
    return pictures


def finger(duration_s: float, seed: int = 0, shape: tuple[int, int] = (320, 240)) -> dict[str, Any]:
    """Return the settings of a finger whose gel is pressed and let go within a duration."""
    path = Path(_folder().name) / f"touch-{duration_s}-{seed}-{shape[0]}.npy"
    if not path.exists():
        np.save(path, _pressed(120 * _effort(max(1, round(duration_s * TOUCH_HZ))), seed, shape))
    return {"driver": "picture-stack", "options": {"file": str(path), "rate_hz": float(TOUCH_HZ)}}


def muscles(duration_s: float, seed: int = 0) -> dict[str, Any]:
    """Return the settings of three muscles that contract in that grasp: raw EMG, microvolts."""
    path = Path(_folder().name) / f"emg-{duration_s}-{seed}.csv"
    if not path.exists():
        effort = _effort(max(1, round(duration_s * EMG_HZ)))
        noise = np.random.default_rng(seed).standard_normal((len(effort), 3))
        samples = noise * (5 + 200 * effort[:, None]) * (1.0, 0.8, 0.6)
        header = "EMG 1 (uV),EMG 2 (uV),EMG 3 (uV)"
        np.savetxt(path, samples, "%.3f", delimiter=",", header=header, comments="", encoding="utf-8")
    return {"driver": "emg-file", "kind": "raw", "options": {"file": str(path), "rate_hz": float(EMG_HZ)}}
