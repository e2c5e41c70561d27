"""Draw pictures: the fingertips in one, with touch maps and Fig 3's marks, and the scene cameras' below each other."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any, Final, TypeAlias

import numpy as np
import viser
from numpy.typing import NDArray

from tega.haptics import FINGERS
from tega.ui.view.browser.state_html import FONT, TILES
from tega.ui.view.state import TouchImage

Pixels: TypeAlias = slice | NDArray[np.intp]

# Of one finger's tile, px: half of a DIGIT's QVGA picture, a little more than the page shows.
TILE_HEIGHT, TILE_WIDTH, GAP = 160, 120, 6
# RGB.
PEAK_GREEN, EDA_BLUE = (39, 208, 69), (59, 140, 255)
_PAPER, _NO_SENSOR = 255, 236
# Until a finger has been pressed harder, so much of the map is white: noise stays dark.
_LEAST_WHITE = {"mm": 0.1, "grey": 12.0}
_PEAK_RADIUS_PX = 5.0


class TouchSheet:
    """Draws the fingers' pictures side by side, thumb first, four a line.

    A touch map is the metric's own, grey, white being the most this finger has shown so far: depth with ``live``,
    pressure with ``paper``. Green circle: the peak. Blue line: the border of the pixels that EDA counts. Where there is
    no map, as of a sensor at another station, the marks are on the dimmed picture, and a blue circle has EDA's area.
    """

    def __init__(self) -> None:
        self._white: dict[tuple[str, str], float] = {}

    def draw(self, images: Mapping[str, TouchImage], fingers: Sequence[str] = FINGERS) -> NDArray[np.uint8]:
        """Return the sheet, uint8 (332 n - 6, 498, 3) of n lines, RGB; a finger without a picture is two grey tiles."""
        n_rows, width = -(-len(fingers) // TILES), TILES * (TILE_WIDTH + GAP) - GAP
        sheet = np.full((2 * n_rows * (TILE_HEIGHT + GAP) - GAP, width, 3), _PAPER, np.uint8)
        for place, finger in enumerate(fingers):
            line, column = divmod(place, TILES)
            top, left = 2 * line * (TILE_HEIGHT + GAP), column * (TILE_WIDTH + GAP)
            upper = sheet[top : top + TILE_HEIGHT, left : left + TILE_WIDTH]
            top += TILE_HEIGHT + GAP
            lower = sheet[top : top + TILE_HEIGHT, left : left + TILE_WIDTH]
            if (image := images.get(finger)) is None:
                upper[...] = lower[...] = _NO_SENSOR
                continue
            rows, columns = _sampling(image.frame.shape)
            upper[...] = image.frame[rows, columns, ::-1]
            self._map(lower, finger, image, rows, columns)
        return sheet

    def _map(
        self, tile: NDArray[np.uint8], finger: str, image: TouchImage, rows: Pixels, columns: Pixels
    ) -> None:
        frame, metrics, touch_map = image
        if touch_map is None:
            tile[...] = frame[rows, columns].mean(axis=2, keepdims=True) / 3
        else:
            height = touch_map.height[_nearest(touch_map.height.shape, TILE_HEIGHT, TILE_WIDTH)]
            kind = finger, touch_map.unit
            least = _LEAST_WHITE.get(touch_map.unit, 1.0)
            white = self._white[kind] = max(self._white.get(kind, least), float(height.max()))
            tile[...] = (height * (255 / white)).astype(np.uint8)[..., None]
        if not metrics.in_contact:
            return
        scale_x, scale_y = TILE_WIDTH / frame.shape[1], TILE_HEIGHT / frame.shape[0]
        middle_x, middle_y = (
            at * scale for at, scale in zip(metrics.centroid_xy, (scale_x, scale_y), strict=True)
        )
        if touch_map is not None:
            tile[_border(touch_map.mask[rows, columns])] = EDA_BLUE
        elif math.isfinite(middle_x + middle_y):
            _circle(tile, middle_x, middle_y, math.sqrt(metrics.eda / math.pi * scale_x * scale_y), EDA_BLUE)
        x, y = metrics.peak_xy
        _circle(tile, x * scale_x, y * scale_y, _PEAK_RADIUS_PX, PEAK_GREEN)


def _sampling(shape: tuple[int, ...]) -> tuple[Pixels, Pixels]:
    height, width = shape[:2]
    if height % TILE_HEIGHT == 0 and width % TILE_WIDTH == 0:
        return slice(None, None, height // TILE_HEIGHT), slice(None, None, width // TILE_WIDTH)
    return _nearest(shape, TILE_HEIGHT, TILE_WIDTH)


def _nearest(shape: tuple[int, ...], n_rows: int, n_columns: int) -> tuple[Pixels, Pixels]:
    """Return the row and column of an array that is nearest to each pixel of a smaller picture."""
    rows = (np.arange(n_rows) * shape[0] // n_rows)[:, None]
    return rows, (np.arange(n_columns) * shape[1] // n_columns)[None, :]


def _border(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the mask's two outermost lines of pixels; it has no border where it leaves the picture."""
    inner = mask.copy()
    for step in (1, 2):
        inner[step:] &= mask[:-step]
        inner[:-step] &= mask[step:]
        inner[:, step:] &= mask[:, :-step]
        inner[:, :-step] &= mask[:, step:]
    border: NDArray[np.bool_] = mask & ~inner
    return border


def _circle(
    tile: NDArray[np.uint8], middle_x: float, middle_y: float, radius: float, colour: tuple[int, int, int]
) -> None:
    """Draw a line of two pixels, as much of it as lies within the tile."""
    turn = np.linspace(0, 2 * math.pi, max(16, round(8 * radius)), endpoint=False)
    reach = np.array([[radius - 0.5], [radius + 0.5]])
    x = np.rint(middle_x + reach * np.cos(turn)).astype(np.intp)
    y = np.rint(middle_y + reach * np.sin(turn)).astype(np.intp)
    inside = (x >= 0) & (x < TILE_WIDTH) & (y >= 0) & (y < TILE_HEIGHT)
    tile[y[inside], x[inside]] = colour


def picture_html(picture: NDArray[np.uint8], alt: str) -> str:
    """Return a picture, uint8 (H, W, 3), RGB, as an image element as wide as where it stands."""
    import imageio.v3

    jpeg: bytes = imageio.v3.imwrite("<bytes>", picture, extension=".jpg", quality=75)
    height, width = picture.shape[:2]
    return (
        f'<img class="tega-sheet" alt="{alt}" width="{width}" height="{height}" decoding="sync"'
        f' src="data:image/jpeg;base64,{base64.b64encode(jpeg).decode()}">'
    )


WIDTH_PX: Final = 360
"""Width of an image, a little less than the panel."""
_HIGHEST_PX: Final = 270


class CameraPictures:
    """Show the newest picture of each scene camera."""

    def __init__(self, gui: viser.GuiApi) -> None:
        self._gui = gui
        self.element: Any = None

    def draw(self, html: str | None) -> None:
        """Show what :func:`cameras_html` gave; nothing where that is none."""
        if self.element is None and html is not None:
            self.element = self._gui.add_html(html)
        elif self.element is not None:
            self.element.content = html or ""


def cameras_html(pictures: Mapping[str, NDArray[np.uint8]]) -> str | None:
    """Return pictures by their cameras' names, uint8 (H, W, 3) in BGR, as HTML; ``None`` without any."""
    parts = []
    for name, picture in sorted(pictures.items()):
        if picture.size:
            text = escape(name)
            drawn = picture_html(_fitted(picture)[..., ::-1], text)
            parts.append(f'<div style="{FONT};padding:4px 10px 0">{text}</div>{drawn}')
    return "".join(parts) or None


def _fitted(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    height, width = picture.shape[:2]
    scale = min(WIDTH_PX / width, _HIGHEST_PX / height)
    rows, columns = (max(1, int(side * scale)) for side in (height, width))
    fitted: NDArray[np.uint8] = picture[_nearest(picture.shape, rows, columns)]
    return fitted
