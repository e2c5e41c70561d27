"""Read a network stream of JPEG pictures at the size that each picture has.

FFmpeg scales every picture of a stream to the size of the first, so a camera that changes its size would pass unseen.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_END: Final = b"\xff\xd9"
# Some senders put a line break or padding behind a picture.
_PADDING: Final = 16
# A stream of which so many packets in a row are no pictures sends something else.
_MOST_SPOILED: Final = 10


class JpegStream:
    """Capture of OpenCV's that gives packets, and decodes them.

    Args:
        cv2: OpenCV.
        capture: An open capture that was set to give packets.
    """

    def __init__(self, cv2: Any, capture: Any) -> None:
        self._cv2, self._capture = cv2, capture
        self._n_spoiled = 0
        self._how = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION

    def read(self) -> tuple[bool, NDArray[np.uint8]]:
        """Return whether a packet came, and its picture, uint8 (H, W, 3); (0, 0, 3) for a packet that is no picture."""
        nothing = np.empty((0, 0, 3), np.uint8)
        came, packet = self._capture.read()
        if not came:
            return False, nothing
        data = np.ascontiguousarray(packet, np.uint8).ravel()
        is_whole = _END in data[-_PADDING:].tobytes()
        image = self._cv2.imdecode(data, self._how) if is_whole else None
        self._n_spoiled = 0 if image is not None else self._n_spoiled + 1
        return self._n_spoiled < _MOST_SPOILED, nothing if image is None else image

    def get(self, setting: int) -> float:
        """Return a property of the capture."""
        return float(self._capture.get(setting))

    def release(self) -> None:
        """Close the capture."""
        self._capture.release()


def at_own_size(cv2: Any, capture: Any) -> Any:
    """Return an open network stream that gives pictures at their own size, where it sends JPEG; else the stream itself.

    Args:
        cv2: OpenCV.
        capture: A stream that was opened through FFmpeg, and from which nothing was read.
    """
    code = int(capture.get(cv2.CAP_PROP_FOURCC))
    if code != cv2.VideoWriter.fourcc(*"MJPG") or not capture.set(cv2.CAP_PROP_FORMAT, -1):
        return capture
    return JpegStream(cv2, capture)
