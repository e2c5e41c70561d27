"""Write scene recordings of made-up cameras: the stripes of a picture say its number."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from foxglove import channels, messages
from numpy.typing import NDArray

from tega.recording.record_channels import McapFile
from tega_scene.settings import VideoFormat
from tega_scene.video import SceneEncoder

EPOCH_NS = 10**18
SIZE = (96, 64)


def numbered(number: int) -> NDArray[np.uint8]:
    """Return a picture, uint8 (64, 96, 3): eight stripes, the bits of a number below 256, white for one."""
    stripes = 255 * (number >> np.arange(8) & 1).repeat(SIZE[0] // 8)
    return np.broadcast_to(stripes[None, :, None], (SIZE[1], SIZE[0], 3)).astype(np.uint8)


def film(path: Path, n: int = 30, rate_hz: float = 20.0) -> Path:
    """Write a video file of such pictures, twice as large."""
    size = (2 * SIZE[0], 2 * SIZE[1])
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), rate_hz, size)
    for number in range(n):
        writer.write(cv2.resize(numbered(number), size))
    writer.release()
    return path


def number_of(image: NDArray[np.uint8]) -> int:
    """Return which number a picture of any size shows; no coding of a video moves a stripe across middle grey."""
    stripes = np.array_split(image.mean(axis=(0, 2)), 8)
    return sum(int(stripe.mean() > 127) << bit for bit, stripe in enumerate(stripes))


def packets(
    times_ns: Sequence[int], video: VideoFormat = "h264", rate_hz: float = 10.0
) -> list[tuple[int, bytes]]:
    """Return a video, one of so many pictures a second standing alone."""
    encoder = SceneEncoder(*SIZE, rate_hz=rate_hz, video=video)
    made = []
    for number, t_ns in enumerate(times_ns):
        (packet,) = encoder.encode(numbered(number), t_ns)  # one a picture, and none waits
        made.append(packet)
    assert not encoder.close()
    return made


def write_scene(
    path: Path, cameras: dict[str, list[tuple[int, bytes]]], *, video: str = "h264", table: Any = None
) -> Path:
    """Write packets by the monotonic clock as ``scene record`` does, in the order of their times."""
    file = McapFile(path, lossless=True)
    file.metadata("tega_scene", {"clock": "monotonic", "epoch_ns": str(EPOCH_NS)} if table is None else table)
    open_channels = {
        name: channels.CompressedVideoChannel(f"/scene/{name}/video", context=file.context)
        for name in cameras
    }
    every = sorted((t_ns, name, data) for name, found in cameras.items() for t_ns, data in found)
    for k, (t_ns, name, data) in enumerate(every):
        at = messages.Timestamp(*divmod(EPOCH_NS + t_ns, 1_000_000_000))
        message = messages.CompressedVideo(timestamp=at, frame_id=name, data=data, format=video)
        open_channels[name].log(message, log_time=EPOCH_NS + t_ns)
        if k % 20 == 19:
            file.flush()  # which ends a part of the file
    file.close()
    return path
