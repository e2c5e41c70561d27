"""A synthetic fingertip camera: a ball pressed into a gel lit from three sides.

Simulated. It models what makes a DIGIT picture: slopes, not depth, are visible, each light brightens the flank that
faces it, the dent reaches beyond the contact, and chroma noise exceeds luma noise. It does not model cast shadows,
saturation of steep slopes, the gel's dome, drift or hysteresis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Press", "PressCamera"]

HEIGHT, WIDTH = 320, 240
PX_PER_MM = 18.68
# Directions towards the lights in the picture, degrees from +x with y down, and counts per unit slope (B, G, R).
LIGHT_DEG = (79.0, 199.0, 306.0)
COUNTS_PER_SLOPE = (165.0, 110.0, 150.0)
# Per-pixel noise of one frame (B, G, R), counts, before the 2-pixel averaging that the sensor's 4:2:2 picture shows.
NOISE_SD = (3.17, 1.65, 2.74)
# Outside the contact the slope dies away over this length, px.
DENT_LENGTH_PX = 20.0
# Noisy pictures of the untouched gel that frames are drawn from.
STILL_FRAMES = 16
# Background of one gel, counts: constant, x, y, x², xy, y² with x and y from -1 to 1 (B, G, R).
BACKGROUND = (
    (114.0, -20.0, 8.0, -23.0, -24.0, -20.0),
    (121.0, -6.0, -23.0, -27.0, 32.0, -20.0),
    (113.0, -28.0, -27.0, -9.0, -43.0, -31.0),
)


@dataclass(frozen=True)
class Press:
    """A ball against the gel.

    Args:
        depth_mm: Indentation; 0 is no contact.
        centre_xy: Where, pixels.
        radius_mm: The ball's radius.
    """

    depth_mm: float
    centre_xy: tuple[float, float] = (WIDTH / 2, HEIGHT / 2)
    radius_mm: float = 4.4


class PressCamera:
    """Frames of shape (320, 240, 3), uint8, BGR; the same seed gives the same frames.

    Args:
        seed: Seed of the noise and of the gel's background.

    Example:
        >>> camera = PressCamera(seed=1)
        >>> frame = camera.frame(Press(depth_mm=0.8))
        >>> frame.shape, frame.dtype
        ((320, 240, 3), dtype('uint8'))
    """

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)
        y, x = np.mgrid[-1 : 1 : HEIGHT * 1j, -1 : 1 : WIDTH * 1j].astype(np.float32)
        terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y])
        tint = 1 + 0.08 * self._rng.standard_normal((3, 6), dtype=np.float32)
        background = np.moveaxis(np.tensordot(np.array(BACKGROUND, np.float32) * tint, terms, 1), 0, -1)
        still = [background + self._noise() for _ in range(STILL_FRAMES)]
        self._still = np.rint(still).astype(np.int16)
        # Never the same picture twice in a row: a working sensor does not repeat itself.
        order = np.cumsum(self._rng.integers(1, STILL_FRAMES, size=4099)) % STILL_FRAMES
        self._order = order if order[0] != order[-1] else order[:-1]

    def baseline(self) -> NDArray[np.uint8]:
        """Return the mean of the still pictures, uint8 (320, 240, 3)."""
        mean: NDArray[np.uint8] = np.clip(np.rint(self._still.mean(axis=0)), 0, 255).astype(np.uint8)
        return mean

    def frame(self, press: Press, number: int = 0) -> NDArray[np.uint8]:
        """Return one picture of ``press``, uint8 (320, 240, 3), BGR; ``number`` picks its noise."""
        image = self._still[self._order[number % self._order.size]].copy()
        if press.depth_mm > 0:
            self._press(image, press)
        picture: NDArray[np.uint8] = np.clip(image, 0, 255).astype(np.uint8)
        return picture

    def _noise(self) -> NDArray[np.float32]:
        """Noise whose neighbours along the columns share their value in pairs, as 4:2:2 chroma does."""
        noise = self._rng.standard_normal((HEIGHT // 2, WIDTH, 3), dtype=np.float32)
        return np.repeat(noise, 2, axis=0) * np.array(NOISE_SD, np.float32)

    @staticmethod
    def _press(image: NDArray[np.int16], press: Press) -> None:
        """Add the dent's colour change, slope along each light's direction times its gain, where it is visible."""
        radius_px = press.radius_mm * PX_PER_MM
        contact_px = float(np.sqrt(2 * radius_px * press.depth_mm * PX_PER_MM)) / 1.3
        reach = contact_px + 6 * DENT_LENGTH_PX
        (x, y), (height, width, _) = press.centre_xy, image.shape
        columns = np.arange(max(0, int(x - reach)), min(width, int(x + reach) + 1), dtype=np.float32)
        rows = np.arange(max(0, int(y - reach)), min(height, int(y + reach) + 1), dtype=np.float32)
        if not (columns.size and rows.size):
            return
        dx, dy = np.meshgrid(columns - np.float32(x), rows - np.float32(y))
        distance = np.hypot(dx, dy) + np.float32(1e-6)
        outside = (contact_px / radius_px) * np.exp((contact_px - distance) / np.float32(DENT_LENGTH_PX))
        steepness = np.where(distance < contact_px, distance / radius_px, outside) / distance
        window = image[int(rows[0]) : int(rows[-1]) + 1, int(columns[0]) : int(columns[-1]) + 1]
        for channel, (angle, gain) in enumerate(zip(np.radians(LIGHT_DEG), COUNTS_PER_SLOPE, strict=True)):
            towards = dx * np.float32(gain * np.cos(angle)) + dy * np.float32(gain * np.sin(angle))
            window[..., channel] += np.rint(steepness * towards).astype(np.int16)
