"""The pictures that are measured on: a ball pressed into a generated gel, at any size.

The camera is generated and has one size, upright. Other sizes repeat or leave out its pixels, lying ones are turned:
what a kernel has to do per pixel is the same.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega_sim.gel import Gel, ball

__all__ = ["SIZES", "SIZE_OF_A_FINGER", "SIZE_OF_A_SENSOR", "BenchScene", "scenes", "untouched"]

# Height and width: a DIGIT, a quarter and four of it, a raw 8-megapixel sensor.
SIZE_OF_A_FINGER = (320, 240)
SIZE_OF_A_SENSOR = (2464, 3280)
SIZES = (SIZE_OF_A_FINGER, (160, 120), (640, 480), SIZE_OF_A_SENSOR)

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
        >>> scenes((160, 120))[0].frame.shape
        (160, 120, 3)
    """
    gel = Gel(seed)
    still = _sized(gel.still(), size)
    found = []
    for n, (force_n, centre_xy) in enumerate(PRESSES):
        image = gel.frame([ball(force_n=force_n, centre_xy=centre_xy)], n)
        found.append(BenchScene(_sized(_brightened(image, gel.truth.depth_mm, centre_xy), size), still))
    return found


def untouched(size: tuple[int, int], *, seed: int = 7) -> NDArray[np.uint8]:
    """Return a picture of the gel of :func:`scenes` at rest, which differs from its baseline by the camera's noise."""
    return _sized(Gel(seed).frame([], 0), size)


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
    turned = image if size[0] > size[1] else image.swapaxes(0, 1)
    rows, columns = (np.arange(n) * side // n for n, side in zip(size, turned.shape, strict=False))
    return np.ascontiguousarray(turned[np.ix_(rows, columns)])
