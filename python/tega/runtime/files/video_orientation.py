"""Turn and mirror the frames of a video as its rotation tag says."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def oriented(image: NDArray[np.uint8], matrix: tuple[int, int, int, int]) -> NDArray[np.uint8]:
    """Return a picture, uint8 (H, W, 3), as players show it.

    ``matrix`` has the display matrix's signs (a, b, c, d): a pixel at (x, y) is shown at (ax + cy, bx + dy).
    """
    a, b, c, d = matrix
    if a and d:
        return np.ascontiguousarray(image[:: 1 if d > 0 else -1, :: 1 if a > 0 else -1])
    turned = image.transpose(1, 0, 2)
    return np.ascontiguousarray(turned[:: 1 if b > 0 else -1, :: 1 if c > 0 else -1])


def display_matrix(frame: Any) -> tuple[int, int, int, int] | None:
    """Return the signs of a frame's display matrix; ``None`` for none, and for an angle that is no multiple of 90°."""
    data = next((bytes(one) for one in frame.side_data if one.type.name == "DISPLAYMATRIX"), b"")
    if len(data) != 36:
        return None
    a, b, _, c, d = np.frombuffer(data, np.int32, 5).astype(np.int64)
    signs = tuple(int(np.sign(v)) for v in (a, b, c, d))
    square = (signs[0] and signs[3] and not b and not c) or (signs[1] and signs[2] and not a and not d)
    return (signs[0], signs[1], signs[2], signs[3]) if square else None
