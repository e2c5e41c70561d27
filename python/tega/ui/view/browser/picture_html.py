"""Turn a picture into an image element of a page that brings its pixels along.

The browser loads viser's own images from separate addresses. A slow browser is sent the next image's address before
it has loaded the last one, and shows none.
"""

from __future__ import annotations

import base64

import numpy as np
from numpy.typing import NDArray


def picture_html(picture: NDArray[np.uint8], alt: str) -> str:
    """Return a picture as an image element as wide as where it stands.

    Args:
        picture: uint8 (H, W, 3), RGB.
        alt: Description for screen readers; HTML.
    """
    import imageio.v3

    jpeg: bytes = imageio.v3.imwrite("<bytes>", picture, extension=".jpg", quality=75)
    height, width = picture.shape[:2]
    return (
        f'<img class="tega-sheet" alt="{alt}" width="{width}" height="{height}" decoding="sync"'
        f' src="data:image/jpeg;base64,{base64.b64encode(jpeg).decode()}">'
    )
