"""Prints a digest of what the kernels answer to fixed input, so that answers of different processors can be compared.

Run as a script by ``tests/unit/test_dispatch.py``. The input comes from integers alone: NumPy's own transcendental
functions may differ from one processor to another.
"""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import NDArray

from tega import _native
from tega.emg import ButterworthLowpass, GraspIntent
from tega.tactile import contact_mask, contact_metrics, read_contact

SIZES = ((120, 160), (240, 320), (61, 83))


def pictures(size: tuple[int, int], rng: np.random.Generator) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return a frame with two dents, lit from three sides, over noise, and its baseline."""
    height, width = size
    baseline = rng.integers(80, 120, (height, width, 3), np.uint8)
    y, x = np.mgrid[:height, :width]
    change = rng.integers(-4, 5, (height, width, 3))
    for cx, cy in ((width // 4, height // 3), (3 * width // 4, 2 * height // 3)):
        dx, dy, radius = x - cx, y - cy, min(size) // 6
        inside = dx * dx + dy * dy < radius * radius
        light = np.stack([dy, -dx - dy // 2, dx - dy // 2], axis=-1) * 60 // radius
        change += np.where(inside[..., np.newaxis], light, 0)
    return np.clip(baseline + change, 0, 255).astype(np.uint8), baseline


def main() -> None:
    """Print the instruction set and the digest."""
    digest, rng = hashlib.sha256(), np.random.default_rng(7)
    for size in SIZES:
        frame, baseline = pictures(size, rng)
        for difference in ("signed", "rectified", "absolute"):
            for spread in ("spatial", "intensity"):
                answer = contact_metrics(frame, baseline, difference=difference, spread=spread)
                digest.update(repr(answer).encode())
        for reading in ("live", "paper"):
            digest.update(repr(read_contact(frame, baseline, reading=reading)).encode())
            digest.update(contact_mask(frame, baseline, reading=reading).tobytes())
    samples = rng.integers(-2000, 2001, (4000, 3)).astype(np.float64)
    digest.update(ButterworthLowpass(1000.0, 6.0, channels=3).process(samples).tobytes())
    for preset in ("paper", "live"):
        intent = GraspIntent(1000.0, [900.0, 800.0, 1000.0], tau=100, preset=preset)
        digest.update(intent.process(samples).tobytes())
    print(_native.instruction_set(), digest.hexdigest())  # noqa: T201  # what it is for


if __name__ == "__main__":
    main()
