"""Decode scene video packet by packet, to hold what :mod:`tega.scene.video` encodes against what was filmed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tega.errors import RecordingError
from tega.lifecycle import require
from tega.scene.video import VideoFormat

if TYPE_CHECKING:
    from numpy.typing import NDArray

_DECODERS: Final[dict[VideoFormat, str]] = {"h264": "h264", "av1": "libdav1d"}


class SceneDecoder:
    """Decodes packets as they come.

    Args:
        video: Their format.

    Raises:
        MissingExtraError: PyAV is not installed.
    """

    def __init__(self, video: VideoFormat = "h264") -> None:
        self._av: Any = require("av", driver="scene", extra="lerobot")
        self._context = self._av.CodecContext.create(_DECODERS[video], "r")
        self._context.thread_count = 1
        if video == "av1":
            self._context.options = {"max_frame_delay": "1"}
        self._times: list[int] = []

    def decode(self, t_ns: int, packet: bytes) -> Iterator[tuple[int, NDArray[np.uint8]]]:
        """Return the pictures that a packet completes: time and uint8 (H, W, 3) in blue, green, red.

        Raises:
            RecordingError: The packet is damaged.
        """
        self._times.append(t_ns)
        yield from self._frames(self._av.Packet(packet))

    def close(self) -> Iterator[tuple[int, NDArray[np.uint8]]]:
        """Return the pictures that the decoder still has."""
        yield from self._frames(None)

    def _frames(self, packet: Any) -> Iterator[tuple[int, NDArray[np.uint8]]]:
        try:
            frames = self._context.decode(packet)
        except self._av.FFmpegError as error:
            raise RecordingError(
                f"a picture of the video cannot be decoded: {error}", "the recording is damaged"
            ) from error
        for frame in frames:
            yield self._times.pop(0), np.asarray(frame.to_ndarray(format="bgr24"), np.uint8)
