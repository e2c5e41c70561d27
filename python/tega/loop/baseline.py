"""Find a finger's baseline: given, or estimated from the recording's quietest frames."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from tega.devices.base import SkippingSource, TactileSource
from tega.errors import CalibrationError
from tega.loop.baseline_match import check_baseline
from tega.runtime.opencv import read_image
from tega.tactile import estimate_baseline

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


# Enough frames to contain quiet ones, few enough to hold in memory whatever the picture's size.
MOST_FRAMES = 96
LEAST_FRAMES = 16
MOST_BYTES = 512 * 1024 * 1024
# Frames that a given baseline is compared with, and the largest distance between them.
FEW_FRAMES, MOST_STRIDE = 5, 30


def find_baseline(source: TactileSource, given: Path | None, *, finger: str) -> tuple[NDArray[np.uint8], str]:
    """Return a finger's baseline and where it came from.

    Args:
        source: Its open source; a recording is left at its beginning.
        given: The baseline's file, or ``None`` to estimate it.
        finger: For the messages.

    Returns:
        uint8 (H, W, 3), and a sentence for the summary.

    Raises:
        RecordingError: The file is no picture or has another size, or a frame cannot be read.
        CalibrationError: There is nothing to estimate it from, or the file is no baseline of these pictures.
    """
    if given is not None:
        baseline = read_image(given, driver=source.info.driver)
        if not source.info.live:
            pictures = _few(source)
            source.open()
            check_baseline(baseline, pictures, name=given.name, label=source.info.label)
        return baseline, given.name
    if source.info.live:
        raise CalibrationError(
            f"finger {finger!r} has a live sensor and no baseline",
            "calibrate it (tega-teleop calibrate), or name a picture of the untouched gel",
        )
    frames = _spread(source)
    n_items = source.info.n_items
    source.open()
    if not frames:
        raise CalibrationError(
            f"finger {finger!r}: {source.info.label} holds no frame", "give a baseline picture"
        )
    text = f"estimated from the quietest of {len(frames)} frames spread over the recording"
    if n_items is not None and n_items == len(frames):
        text = f"estimated from the quietest of the recording's {len(frames)} frames"
    return estimate_baseline(frames), text


def _few(source: TactileSource) -> list[NDArray[np.uint8]]:
    """Read a few frames from the first ones on, with distances between them; decoding a whole video would take long."""
    frames: list[NDArray[np.uint8]] = []
    stride = min(MOST_STRIDE, max(1, (source.info.n_items or 1) // FEW_FRAMES))
    while not source.ended and len(frames) < FEW_FRAMES:
        frame = source.read(0.0)
        if frame is not None:
            frames.append(frame.image)
            _pass_over(source, stride - 1)
    return frames


def _spread(source: TactileSource) -> list[NDArray[np.uint8]]:
    """Read frames at even distances over a recording, as many as fit."""
    frames: list[NDArray[np.uint8]] = []
    stride = 1
    while not source.ended:
        frame = source.read(0.0)
        if frame is None:
            continue
        if not frames:
            most = min(MOST_FRAMES, max(LEAST_FRAMES, MOST_BYTES // frame.image.nbytes))
            stride = max(1, -(-(source.info.n_items or 1) // most))
        frames.append(frame.image)
        _pass_over(source, stride - 1)
    return frames


def _pass_over(source: TactileSource, n_frames: int) -> None:
    if isinstance(source, SkippingSource):
        source.skip(n_frames)
        return
    for _ in range(n_frames):
        source.read(0.0)
