"""Write videos with PyAV's encoders: any codec and container, frames at any times."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from tega.runtime.threads import restored

ENCODERS: Mapping[str, tuple[str, Mapping[str, str]]] = {
    "h264": ("libx264", {}),
    "hevc": ("libx265", {"x265-params": "log-level=none"}),
    "av1": ("libsvtav1", {"preset": "12"}),
    "vp9": ("libvpx-vp9", {"cpu-used": "8", "deadline": "realtime"}),
    "ffv1": ("ffv1", {}),
    "mjpeg": ("mjpeg", {}),
}
CODECS: Mapping[str, Sequence[str]] = {
    "h264": (".mp4", ".mkv", ".mov", ".ts"),
    "hevc": (".mp4", ".mkv"),
    "av1": (".mp4", ".mkv", ".webm"),
    "vp9": (".webm", ".mkv", ".mp4"),
    "ffv1": (".mkv",),
    "mjpeg": (".mov", ".mkv"),
}
"""Of each codec the containers that keep any time of a frame, in thousandths of a second."""
HEIGHT, WIDTH = 64, 96


def numbered(n: int) -> list[NDArray[np.uint8]]:
    """Return pictures, each of its own shade in the middle; the top left corner is red."""
    pictures = []
    for k in range(n):
        picture = np.full((HEIGHT, WIDTH, 3), 60, np.uint8)
        picture[16:48, 24:72] = round(80 + 160 * k / max(n - 1, 1))
        picture[:16, :24] = (20, 20, 220)
        pictures.append(picture)
    return pictures


def shade(picture: NDArray[np.uint8]) -> float:
    """Return how light a picture's middle is."""
    height, width = picture.shape[:2]
    return float(picture[height // 2 - 8 : height // 2 + 8, width // 2 - 8 : width // 2 + 8].mean())


def encode(
    path: Path, pictures: Sequence[NDArray[np.uint8]], times_ms: Sequence[int], *, codec: str, **more: Any
) -> Path:
    """Write a video.

    Args:
        path: Its ending names the container.
        pictures: uint8 (H, W, 3), blue, green, red.
        times_ms: Time of each.
        codec: One of :data:`ENCODERS`.
        more: ``rotation``: degrees counterclockwise that a player turns it by; ``options``: of the container.
    """
    os.environ.setdefault("SVT_LOG", "1")  # errors only
    encoder, options = ENCODERS[codec]
    with av.open(str(path), "w", options=more.get("options", {})) as container:
        stream: Any = container.add_stream(encoder, 30, options=dict(options))
        stream.height, stream.width = pictures[0].shape[:2]
        stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
        stream.time_base = stream.codec_context.time_base = Fraction(1, 1000)
        if "rotation" in more:
            stream.set_display_rotation(more["rotation"])
        with restored():
            stream.codec_context.open()
        for picture, t_ms in zip(pictures, times_ms, strict=True):
            frame = av.VideoFrame.from_ndarray(picture, format="bgr24")
            frame.pts, frame.time_base = t_ms, Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path
