"""Four fingertips in one picture: the cameras above, the touch maps with Fig 3's marks below."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from tega.haptics import FINGERS
from tega.tactile import contact_mask, pressure_map, read_contact

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega.view.state import TouchImage

__all__ = ["TouchSheet"]

# Of one finger's tile, px.
TILE_HEIGHT, TILE_WIDTH, GAP = 224, 168, 8
# RGB.
PEAK_GREEN, EDA_BLUE = (39, 208, 69), (59, 140, 255)
_PAPER, _NO_SENSOR = 255, 236
# Until a finger has been pressed harder, so many counts of the map are white: noise stays dark.
_LEAST_WHITE = 12.0
_LINE_PX, _PEAK_RADIUS_PX = 2.2, 7.0

Picture = "NDArray[np.uint8]"


class TouchSheet:
    """Draws the fingers' pictures side by side, thumb first.

    A touch map is grey, white being the most this finger has shown so far. Green circle: the peak. Blue line: the border
    of the pixels that EDA counts; blue circle: a disc of their area at their middle.
    """

    def __init__(self) -> None:
        self._white = dict.fromkeys(FINGERS, _LEAST_WHITE)

    def draw(self, images: Mapping[str, TouchImage]) -> NDArray[np.uint8]:
        """Return the sheet, uint8 (2 tiles + gap, 4 tiles + gaps, 3), RGB; a finger without a picture is a grey tile."""
        n = len(FINGERS)
        sheet = np.full((2 * TILE_HEIGHT + GAP, n * TILE_WIDTH + (n - 1) * GAP, 3), _PAPER, np.uint8)
        for column, finger in enumerate(FINGERS):
            left = column * (TILE_WIDTH + GAP)
            upper = sheet[:TILE_HEIGHT, left : left + TILE_WIDTH]
            lower = sheet[TILE_HEIGHT + GAP :, left : left + TILE_WIDTH]
            if (image := images.get(finger)) is None:
                upper[...] = lower[...] = _NO_SENSOR
                continue
            rows, columns = _sampling(image.frame.shape[:2])
            upper[...] = image.frame[rows, columns, ::-1]
            self._map(lower, finger, image, rows, columns)
        return sheet

    def _map(
        self,
        tile: NDArray[np.uint8],
        finger: str,
        image: TouchImage,
        rows: NDArray[np.intp],
        columns: NDArray[np.intp],
    ) -> None:
        frame, baseline, reading = image
        pressure = pressure_map(frame, baseline, reading)[rows, columns]
        white = self._white[finger] = max(self._white[finger], float(pressure.max()))
        tile[...] = np.clip(pressure * (255 / white), 0, 255).astype(np.uint8)[..., None]
        metrics = read_contact(frame, baseline, reading=reading)
        if not metrics.in_contact:
            return
        height, width = frame.shape[:2]
        to_tile = np.array([TILE_WIDTH / width, TILE_HEIGHT / height])
        mask = contact_mask(frame, baseline, reading)
        if mask.any():
            _tint(tile, _border(mask[rows, columns]), EDA_BLUE)
            centre = np.array([np.mean(axis) for axis in np.nonzero(mask)[::-1]]) * to_tile
            _circle(tile, centre, math.sqrt(metrics.eda / math.pi * to_tile.prod()), EDA_BLUE)
        _circle(tile, np.array(metrics.peak_xy) * to_tile, _PEAK_RADIUS_PX, PEAK_GREEN)


def _sampling(shape: tuple[int, ...]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the rows and columns of a picture that a tile shows."""
    height, width = shape
    rows = (np.arange(TILE_HEIGHT) * height // TILE_HEIGHT)[:, None]
    columns = (np.arange(TILE_WIDTH) * width // TILE_WIDTH)[None, :]
    return rows, columns


def _border(mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return how much of each pixel is the mask's outer border: 1 there, 0 elsewhere."""
    inner = mask.copy()
    inner[1:] &= mask[:-1]
    inner[:-1] &= mask[1:]
    inner[:, 1:] &= mask[:, :-1]
    inner[:, :-1] &= mask[:, 1:]
    return (mask & ~inner).astype(np.float32)


def _circle(
    tile: NDArray[np.uint8],
    centre_xy: NDArray[np.float64],
    radius: float,
    colour: tuple[int, int, int],
) -> None:
    y, x = np.ogrid[:TILE_HEIGHT, :TILE_WIDTH]
    off_line = np.abs(np.hypot(x - centre_xy[0], y - centre_xy[1]) - radius)
    _tint(tile, np.clip((_LINE_PX + 1) / 2 - off_line, 0, 1).astype(np.float32), colour)


def _tint(tile: NDArray[np.uint8], share: NDArray[np.float32], colour: tuple[int, int, int]) -> None:
    where = share > 0
    part = share[where][:, None]
    tile[where] = (tile[where] * (1 - part) + np.array(colour, np.float32) * part).astype(np.uint8)
