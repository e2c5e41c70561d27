"""The pictures that are measured on: a ball pressed into a generated gel, at four sizes.

The camera is generated and has one size. Smaller pictures are every other pixel of it, larger ones repeat its
pixels and are cut to size: what a kernel has to do per pixel is the same.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega_sim.gel import Gel, ball

__all__ = ["SIZES", "SIZE_OF_A_FINGER", "SIZE_OF_A_SENSOR", "BenchScene", "scenes"]

# Height and width: a quarter, one DIGIT (its picture upright is 320×240), four of it, a raw 8-megapixel sensor.
SIZE_OF_A_FINGER = (240, 320)
SIZE_OF_A_SENSOR = (2464, 3280)
SIZES = ((120, 160), SIZE_OF_A_FINGER, (480, 640), SIZE_OF_A_SENSOR)

# Force in newtons, and where: some 0.2, 0.3 and 0.4 mm deep.
PRESSES = ((0.3, (180.0, 240.0)), (0.5, (120.0, 160.0)), (0.8, (90.0, 100.0)))
# A dent's flanks cancel in the signed difference, and the equations as printed then have no value. A bright spot under
# the ball, as high as this per millimetre of depth and as wide, gives them one.
SPOT_COUNTS_PER_MM, SPOT_SD_PX = 300.0, 18.0


class BenchScene(NamedTuple):
    """One picture and what it looked like without contact, uint8 (H, W, 3), BGR."""

    frame: NDArray[np.uint8]
    baseline: NDArray[np.uint8]


def scenes(size: tuple[int, int], *, seed: int = 7) -> list[BenchScene]:
    """Return one scene a press, C-contiguous.

    Args:
        size: Height and width.
        seed: Of the gel and its noise.

    Example:
        >>> scenes((120, 160))[0].frame.shape
        (120, 160, 3)
    """
    gel = Gel(seed)
    still = _sized(gel.still(), size)
    found = []
    for n, (force_n, centre_xy) in enumerate(PRESSES):
        image = gel.frame([ball(force_n=force_n, centre_xy=centre_xy)], n)
        found.append(BenchScene(_sized(_brightened(image, gel.truth.depth_mm, centre_xy), size), still))
    return found


def _brightened(
    image: NDArray[np.uint8], depth_mm: float, centre_xy: tuple[float, float]
) -> NDArray[np.uint8]:
    rows, columns = np.ogrid[: image.shape[0], : image.shape[1]]
    x, y = centre_xy
    square = ((columns - x) ** 2 + (rows - y) ** 2) / SPOT_SD_PX**2
    spot = SPOT_COUNTS_PER_MM * depth_mm * np.exp(-square / 2)
    bright: NDArray[np.uint8] = np.clip(np.rint(image + spot[..., np.newaxis]), 0, 255).astype(np.uint8)
    return bright


def _sized(image: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.uint8]:
    lying = image.swapaxes(0, 1)
    step = max(lying.shape[0] // size[0], 1)
    lying = lying[::step, ::step]
    times = max(-(-size[0] // lying.shape[0]), -(-size[1] // lying.shape[1]))
    lying = lying.repeat(times, axis=0).repeat(times, axis=1)
    return np.ascontiguousarray(lying[: size[0], : size[1]])
