"""Draw the scene cameras' pictures below each other in one picture."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tega.view.browser.state_html import FONT

if TYPE_CHECKING:
    import viser
    from numpy.typing import NDArray

__all__ = ["CameraPictures", "camera_sheet"]

WIDTH_PX: Final = 360
"""Of the sheet, a little less than the panel."""
_HIGHEST_PX, _GAP_PX = 270, 6
_PAPER: Final = 255


class CameraPictures:
    """The newest picture of each scene camera.

    Args:
        gui: viser's GUI; a heading and the pictures are added to its main panel with the first of them.
    """

    def __init__(self, gui: viser.GuiApi) -> None:
        self._gui = gui
        self._names: tuple[str, ...] = ()
        self.heading: Any = None
        self.image: Any = None

    def draw(self, sheet: NDArray[np.uint8] | None, names: tuple[str, ...] | None = None) -> None:
        """Show a sheet, uint8 (H, W, 3), RGB, and whose pictures it has, where that has changed."""
        if self.image is None:
            if sheet is None:
                return
            self.heading, self.image = self._gui.add_html(""), self._gui.add_image(sheet, jpeg_quality=80)
        elif sheet is not None:
            self.image.image = sheet
        self.image.visible = sheet is not None
        if names is not None and names != self._names:
            self._names = names
            told = escape(" · ".join(names))
            self.heading.content = f'<div style="{FONT};padding:4px 10px 0">scene: {told}</div>'


def camera_sheet(pictures: Mapping[str, NDArray[np.uint8]]) -> NDArray[np.uint8] | None:
    """Return pictures, uint8 (H, W, 3) in BGR, below each other as uint8 (H, W, 3) in RGB; ``None`` without any."""
    tiles = [_fitted(picture) for picture in pictures.values() if picture.size]
    if not tiles:
        return None
    height = sum(len(tile) for tile in tiles) + _GAP_PX * (len(tiles) - 1)
    sheet = np.full((height, WIDTH_PX, 3), _PAPER, np.uint8)
    top = 0
    for tile in tiles:
        sheet[top : top + len(tile), : tile.shape[1]] = tile[..., ::-1]
        top += len(tile) + _GAP_PX
    return sheet


def _fitted(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a picture as large as it fits into its place, by the nearest pixels."""
    height, width = picture.shape[:2]
    scale = min(WIDTH_PX / width, _HIGHEST_PX / height)
    rows, columns = (max(1, int(side * scale)) for side in (height, width))
    fitted: NDArray[np.uint8] = picture[
        (np.arange(rows) * height // rows)[:, None], (np.arange(columns) * width // columns)[None, :]
    ]
    return fitted
