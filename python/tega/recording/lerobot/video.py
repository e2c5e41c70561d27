"""One finger's pictures as videos: AV1 in MP4, as LeRobot writes them."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tega.devices.lifecycle import require

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["CODEC", "PIXELS", "Video"]

CODEC, PIXELS = "libsvtav1", "yuv420p"
# Every other frame can be decoded on its own, since training reads frames at random.
_OPTIONS = {"g": "2", "crf": "30"}


class Video:
    """A video that grows by pictures.

    Args:
        path: The file.
        fps: Frames per second.
        height: Of the pictures, pixels, an even number.
        width: Likewise.

    Attributes:
        n_frames: How many it has.

    Raises:
        MissingExtraError: The package ``av`` is not installed.
    """

    def __init__(self, path: Path, *, fps: int, height: int, width: int) -> None:
        self._av: Any = require("av", driver="export", extra="lerobot")
        os.environ.setdefault("SVT_LOG", "1")  # errors only: the encoder tells its settings otherwise
        path.parent.mkdir(parents=True, exist_ok=True)
        self.path = path
        self._file = self._av.open(str(path), "w")
        self._stream = self._file.add_stream(CODEC, fps, options=dict(_OPTIONS))
        self._stream.width, self._stream.height, self._stream.pix_fmt = width, height, PIXELS
        self.n_frames = 0

    def add(self, image: NDArray[np.uint8], n_times: int) -> None:
        """Add a picture, uint8 (H, W, 3) in RGB, so many times in a row."""
        for _ in range(n_times):
            frame = self._av.VideoFrame.from_ndarray(image, format="rgb24")
            frame.pts = self.n_frames
            self.n_frames += 1
            self._file.mux(self._stream.encode(frame))

    def close(self) -> None:
        """Write what the encoder still has, and finish the file."""
        self._file.mux(self._stream.encode())
        self._file.close()
