"""Write scene recordings of made-up cameras: each picture has its number drawn into it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from foxglove import channels, messages
from numpy.typing import NDArray

from tega.recording.mcap_file import McapFile
from tega.scene.video import SceneEncoder, VideoFormat

EPOCH_NS = 10**18
SIZE = (96, 64)


def drawn(number: int) -> NDArray[np.uint8]:
    """Return a picture, uint8 (H, W, 3), with a number below 64 in it: six bars, white for a one, the highest first."""
    bars = np.array([255 * (number >> bit & 1) for bit in range(5, -1, -1)], np.uint8)
    row = np.repeat(bars, SIZE[0] // 6)
    return np.ascontiguousarray(np.broadcast_to(row[None, :, None], (SIZE[1], SIZE[0], 3)))


def number_of(image: NDArray[np.uint8]) -> int:
    """Return the number that was drawn into a picture, of whatever size it is now.

    Raises:
        AssertionError: A bar is neither black nor white, as where two pictures are mixed.
    """
    width = image.shape[1] / 6
    bars = [float(image[:, round((k + 0.3) * width) : round((k + 0.7) * width)].mean()) for k in range(6)]
    assert all(bar < 32 or bar > 223 for bar in bars), bars
    return sum(1 << (5 - k) for k, bar in enumerate(bars) if bar > 127)


def packets(
    times_ns: Sequence[int], video: VideoFormat = "h264", rate_hz: float = 10.0
) -> list[tuple[int, bytes]]:
    """Return a video, one of so many pictures a second standing alone."""
    encoder = SceneEncoder(*SIZE, rate_hz=rate_hz, video=video)
    made = []
    for number, t_ns in enumerate(times_ns):
        made += encoder.encode(drawn(number), t_ns)
    return [*made, *encoder.close()]


def write_scene(
    path: Path, cameras: dict[str, list[tuple[int, bytes]]], *, video: str = "h264", table: Any = None
) -> Path:
    """Write packets by the monotonic clock as ``scene record`` does, in the order of their times."""
    file = McapFile(path, lossless=True)
    file.metadata("tega.scene", {"clock": "monotonic", "epoch_ns": str(EPOCH_NS)} if table is None else table)
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
