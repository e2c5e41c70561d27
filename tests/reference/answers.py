"""Prints a digest of what the kernels answer to fixed input, so that answers of different processors can be compared.

Run as a script by ``tests/together/test_dispatch.py``. The input comes from integers alone: NumPy's own transcendental
functions may differ from one processor to another.
"""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import NDArray

from tega import _native
from tega.emg import ButterworthLowpass, GraspIntent
from tega.tactile import TouchTracker, contact_mask, contact_metrics, pressure_map, read_contact
from tega_sim.gel import Gel
from tega_sim.seams import Indenter

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


def presses() -> list[Indenter]:
    """Return shapes that press a gel together; a turn by sides of 3, 4 and 5 needs no trigonometry."""
    pose = np.array([[1.0, 0.0, 0.0, 1.0], [0.0, 0.6, -0.8, -2.0], [0.0, 0.8, 0.6, 0.0]])
    aside = pose - [[0, 0, 0, 3], [0, 0, 0, 1], [0, 0, 0, 0]]
    return [
        Indenter("box", (2.0, 3.0, 4.0), pose, 2.0),
        Indenter("cylinder", (2.0, 3.0, 0.0), aside, 1.5),
        Indenter("capsule", (1.0, 2.0, 0.0), aside - [[0, 0, 0, 0], [0, 0, 0, 3], [0, 0, 0, 0]], 1.0),
        Indenter("sphere", (6.0, 0.0, 0.0), pose - [[0, 0, 0, -1], [0, 0, 0, -6], [0, 0, 0, 0]], 3.0),
        Indenter("plane", (0.0, 0.0, 0.0), pose * [[1], [-1], [-1]], 1.0),
    ]


def main() -> None:
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
            digest.update(pressure_map(frame, baseline, reading=reading).tobytes())
        tracker = TouchTracker(baseline, rate_hz=30.0)
        for image, frames in ((baseline, 5), (frame, 20), (baseline, 40), (frame[::-1], 5)):
            for _ in range(frames):
                contact = tracker.update(image)
                names = sorted(name for name in dir(contact) if not name.startswith("_"))
                digest.update(repr([getattr(contact, name) for name in names]).encode())
            digest.update(tracker.mask().tobytes() + tracker.depth_map().tobytes())
    samples = rng.integers(-2000, 2001, (4000, 3)).astype(np.float64)
    digest.update(ButterworthLowpass(1000.0, 6.0, channels=3).process(samples).tobytes())
    for preset in ("paper", "live"):
        intent = GraspIntent(1000.0, [900.0, 800.0, 1000.0], tau=100, preset=preset)
        digest.update(intent.process(samples).tobytes())
    gel, shapes = Gel(8), presses()
    for index in range(len(shapes)):
        digest.update(gel.frame(shapes[index:], index).tobytes())
        digest.update(gel.frame([shapes[index]], 100 + index).tobytes())
        digest.update(repr(gel.truth).encode() + gel.displacement_mm().tobytes())
    print(_native.instruction_set(), digest.hexdigest())  # noqa: T201  # what it is for


if __name__ == "__main__":
    main()
