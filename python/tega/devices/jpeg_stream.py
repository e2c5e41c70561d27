"""Read a network stream of JPEG pictures at the size that each picture has.

FFmpeg scales every picture of a stream to the size of the first, so a camera that changes its size would pass unseen.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

MOST_SPOILED: Final = 10
"""Packets in a row that may be no pictures; a stream of more sends something else."""

_END: Final = b"\xff\xd9"
# Some senders put a line break or padding behind a picture.
_PADDING: Final = 16


def keep_own_size(cv2: Any, capture: Any) -> Any:
    """Set an open network stream to give packets where it sends JPEG, and return it.

    ``capture`` was opened through FFmpeg, and nothing was read from it.
    """
    if int(capture.get(cv2.CAP_PROP_FOURCC)) == cv2.VideoWriter.fourcc(*"MJPG"):
        capture.set(cv2.CAP_PROP_FORMAT, -1)
    return capture


def read_picture(cv2: Any, capture: Any) -> tuple[bool, NDArray[np.uint8]]:
    """Return whether something came, and the picture, uint8 (H, W, 3); (0, 0, 3) for a packet that is no picture."""
    came, sent = capture.read()
    nothing = np.empty((0, 0, 3), np.uint8)
    if not came:
        return False, nothing
    picture = np.asarray(sent, np.uint8)
    if picture.ndim != 2 or len(picture) != 1:  # no packet
        return True, picture
    is_whole = _END in picture[0, -_PADDING:].tobytes()
    how = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
    image = cv2.imdecode(np.ascontiguousarray(picture[0]), how) if is_whole else None
    return True, nothing if image is None else image
