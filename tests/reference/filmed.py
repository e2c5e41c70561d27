"""Write scene recordings of made-up cameras: the grey of a picture says its number."""

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


def grey(number: int) -> int:
    return 40 + 4 * (number % 48)


def number_of(image: NDArray[np.uint8]) -> int:
    """Return which picture of the first 48 this is."""
    # Limited range and rounding make a grey up to three darker.
    return round((float(image.mean()) - 38.5) / 4)


def packets(
    times_ns: Sequence[int], video: VideoFormat = "h264", rate_hz: float = 10.0
) -> list[tuple[int, bytes]]:
    """Return a video, one of so many pictures a second standing alone."""
    encoder = SceneEncoder(*SIZE, rate_hz=rate_hz, video=video)
    made = []
    for number, t_ns in enumerate(times_ns):
        made += encoder.encode(np.full((SIZE[1], SIZE[0], 3), grey(number), np.uint8), t_ns)
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
