"""Encode scene video picture by picture, as Foxglove's CompressedVideo wants it.

H.264 is an Annex B stream, AV1 a stream of temporal units: every packet is one picture, none waits for a later one, and
a picture that stands alone comes at least once a second with all that a decoder needs to begin there.
"""

from __future__ import annotations

import os
from fractions import Fraction
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tega.errors import InvalidValueError, RecordingError
from tega.runtime.lifecycle import require
from tega.runtime.opencv import load_cv2
from tega.runtime.threads import restored
from tega_scene.settings import CRF, VideoFormat

_ENCODERS: Final[dict[VideoFormat, str]] = {"h264": "libx264", "av1": "libsvtav1"}
_TICKS: Final = Fraction(1, 1_000_000)


def _options(video: VideoFormat, crf: int, rate_hz: float) -> dict[str, str]:
    every = str(max(1, round(rate_hz)))
    if video == "h264":
        # This preset alone compares whole pixels: what moves is coded anew in each picture, coarsely. Quarters of a
        # pixel take more time, and halve the error of distance that coding adds (docs/evidence/scene.md).
        return {
            "preset": "ultrafast",
            "x264-params": "subme=2",
            "tune": "zerolatency",
            "crf": str(crf),
            "g": every,
            "bf": "0",
            "threads": "1",
        }
    # pred-struct 1 is low delay: no picture refers to a later one.
    return {
        "preset": "10",
        "crf": str(crf),
        "g": every,
        "svtav1-params": f"pred-struct=1:keyint={every}:lp=1",
    }


class SceneEncoder:
    """Encodes the pictures of one camera, whose sides, pixels, must be even.

    About ``rate_hz`` come a second: one of so many stands alone. A smaller ``crf`` is better quality. A PyAV
    wheel without the encoder raises :class:`MissingExtraError`.
    """

    def __init__(
        self, width: int, height: int, *, rate_hz: float, video: VideoFormat = "h264", crf: int = CRF
    ) -> None:
        if width % 2 or height % 2 or width < 64 or height < 64:
            raise InvalidValueError(
                f"pictures of {width}×{height} cannot be encoded",
                "take a resolution with even sides from 64 pixels",
            )
        self._av: Any = require("av", driver="scene", extra="lab")
        os.environ.setdefault("SVT_LOG", "1")
        self.video: VideoFormat = video
        self._context = self._av.CodecContext.create(_ENCODERS[video], "w")
        self._context.width, self._context.height = width, height
        self._context.pix_fmt, self._context.time_base = "yuv420p", _TICKS
        self._context.framerate = Fraction(round(1000 * rate_hz), 1000)
        self._context.options = _options(video, crf, rate_hz)
        with restored():
            self._context.open()
        self._times: list[int] = []
        self._last = -1

    def encode(self, image: NDArray[np.uint8], t_ns: int) -> list[tuple[int, bytes]]:
        """Add a frame, uint8 (H, W, 3) BGR, or (H, W) grey; return the finished packets with their times."""
        order = "gray" if image.ndim == 2 else "bgr24"
        frame = self._av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format=order)
        # Rising by at least one tick, whatever the camera's clock says.
        self._last = max(self._last + 1, t_ns // 1000)
        frame.pts, frame.time_base = self._last, _TICKS
        self._times.append(t_ns)
        return self._ready(frame)

    def close(self) -> list[tuple[int, bytes]]:
        """Return the packets that the encoder still has."""
        return self._ready(None)

    def _ready(self, frame: Any) -> list[tuple[int, bytes]]:
        try:
            packets = self._context.encode(frame)
        except self._av.FFmpegError as error:
            raise RecordingError(f"a picture cannot be encoded as {self.video}: {error}") from error
        # In the order in which the pictures came: nothing is reordered.
        return [(self._times.pop(0), bytes(packet)) for packet in packets]


def shrunk(image: NDArray[np.uint8], width: int) -> NDArray[np.uint8]:
    """Return a picture, uint8 (H, W, 3), at most ``width`` wide: each pixel the mean of what it covers."""
    if image.shape[1] <= width:
        return image
    cv2 = load_cv2("scene")
    height = max(1, round(image.shape[0] * width / image.shape[1]))
    return np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
