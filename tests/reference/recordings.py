"""Small recordings made up for the tests: pictures, videos, EMG."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

HEIGHT, WIDTH = 60, 80


def baseline(seed: int = 0) -> NDArray[np.uint8]:
    """Return a gel at rest."""
    rng = np.random.default_rng(seed)
    return rng.integers(100, 110, (HEIGHT, WIDTH, 3)).astype(np.uint8)


def pressed(depth: float, *, noise: int, seed: int = 0) -> NDArray[np.uint8]:
    """Return the gel with a round dent of so many grey values in its middle."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    bump = depth * np.exp(-((y - HEIGHT / 2) ** 2 + (x - WIDTH / 2) ** 2) / (2 * 9.0**2))
    flicker = np.random.default_rng(1000 + noise).integers(-1, 2, (HEIGHT, WIDTH, 3))
    image = baseline(seed).astype(float) + bump[..., None] * (1.0, 0.8, 0.6) + flicker
    frame: NDArray[np.uint8] = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    return frame


def depths(n_frames: int) -> list[float]:
    """Return three presses of rising strength, with rest before, between and after."""
    phase = np.arange(n_frames) / n_frames * 3
    return [float(d) for d in (60 + 30 * np.floor(phase)) * np.clip(np.sin(2 * np.pi * phase), 0, 1)]


def write_folder(folder: Path, n_frames: int, *, seed: int = 0) -> Path:
    """Write a folder of PNG frames."""
    folder.mkdir(parents=True, exist_ok=True)
    for k, depth in enumerate(depths(n_frames)):
        cv2.imwrite(str(folder / f"frame_{k}.png"), pressed(depth, noise=k, seed=seed))
    return folder


def write_video(path: Path, n_frames: int, *, rate_hz: float = 60.0, seed: int = 0) -> Path:
    """Write a video."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), rate_hz, (WIDTH, HEIGHT))
    for k, depth in enumerate(depths(n_frames)):
        writer.write(pressed(depth, noise=k, seed=seed))
    writer.release()
    return path


def squeezes(n_samples: int, rate_hz: float, *, channels: int = 3) -> NDArray[np.float64]:
    """Return raw EMG of a squeeze every two seconds."""
    t = np.arange(n_samples) / rate_hz
    effort = 0.05 + np.clip(np.sin(np.pi * t), 0, 1)
    noise = np.random.default_rng(7).standard_normal((n_samples, channels))
    return noise * effort[:, None] * (1 + np.arange(channels)) + 0.3


def write_emg_csv(path: Path, samples: NDArray[np.float64], *, header: Sequence[str] = ()) -> Path:
    """Write EMG as comma separated text."""
    lines = [",".join(header)] if header else []
    lines += [",".join(repr(float(v)) for v in row) for row in samples]
    path.write_text("\n".join(lines) + "\n")
    return path
