"""Show the scene cameras' pictures below each other, each with its camera's name."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from html import escape
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from tega.ui.view.browser.state_html import FONT

if TYPE_CHECKING:
    import viser
    from numpy.typing import NDArray


def picture_html(picture: NDArray[np.uint8], alt: str) -> str:
    """Return a picture, uint8 (H, W, 3), RGB, as an image element as wide as where it stands.

    ``alt`` is for screen readers; HTML.
    """
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
    """Return pictures by their cameras' names, uint8 (H, W, 3) in BGR, as HTML; ``None`` without any.

    The order is that of the names, not that in which the cameras appeared.
    """
    displayed = {
        name: _fitted(picture)[..., ::-1] for name, picture in sorted(pictures.items()) if picture.size
    }
    return "".join(map(_captioned, displayed, displayed.values())) or None


def _captioned(name: str, picture: NDArray[np.uint8]) -> str:
    text = f"scene camera: {escape(name)}"
    return f'<div style="{FONT};padding:4px 10px 0">{text}</div>{picture_html(picture, text)}'


def _fitted(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a picture as large as it fits into its place, by the nearest pixels."""
    height, width = picture.shape[:2]
    scale = min(WIDTH_PX / width, _HIGHEST_PX / height)
    rows, columns = (max(1, int(side * scale)) for side in (height, width))
    fitted: NDArray[np.uint8] = picture[
        (np.arange(rows) * height // rows)[:, None], (np.arange(columns) * width // columns)[None, :]
    ]
    return fitted
