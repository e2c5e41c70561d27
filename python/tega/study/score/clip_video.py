"""Write a recorded trial as a video of its fingertips, every picture whole, so that it can be stepped through.

What is written is what the console for recordings shows: pictures, or on the simulated bench, which has none, three
lines of the object's truth; nothing of the vest, no measure of touch and no muscle signal.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tega.config import FINGERS
from tega.errors import RecordingError
from tega.lifecycle import require
from tega.study.observe.recorded import RecordedTrial
from tega.study.observe.trial_pictures import Reel, read_reel
from tega.view.state import ViewState

RATE_HZ: Final = 30.0
"""Pictures a second of a clip."""

_WIDTH, _HEIGHT = 320, 240
_LINE = 28
_LIGHT = (230, 230, 230)


def write_clip(trial: RecordedTrial, path: Path) -> float:
    """Write a trial as Motion JPEG in an AVI file.

    Args:
        trial: Whose recording is complete.
        path: The new file.

    Returns:
        Its length, seconds; that of the trial to a picture.

    Raises:
        RecordingError: The recording is damaged, or the video cannot be written.
        MissingExtraError: OpenCV is not installed.
    """
    cv2 = require("cv2", driver="a clip", extra="record")
    reel = read_reel(trial)
    n_pictures = max(1, round(trial.length_ns * 1e-9 * RATE_HZ))
    fingers = _fingers(reel, n_pictures)
    size = (_WIDTH * max(len(fingers), 2), _HEIGHT + _LINE)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), RATE_HZ, size)
    try:
        if not writer.isOpened():
            raise RecordingError(f"{path}: the video cannot be written", "is the folder writable?")
        for k in range(n_pictures):
            writer.write(_picture(cv2, reel.at(_at_ns(k), {}), fingers, size))
    finally:
        writer.release()
    return n_pictures / RATE_HZ


def _at_ns(k: int) -> int:
    return round(k / RATE_HZ * 1e9)


def _fingers(reel: Reel, n_pictures: int) -> list[str]:
    """Return the fingers that have a picture anywhere in the trial, thumb first."""
    seen = {
        finger
        for k in range(0, n_pictures, max(1, round(RATE_HZ / 4)))
        for finger in (reel.at(_at_ns(k), {}).images or {})
    }
    return [finger for finger in FINGERS if finger in seen]


def _picture(cv2: Any, state: ViewState, fingers: list[str], size: tuple[int, int]) -> NDArray[np.uint8]:
    canvas = np.zeros((size[1], size[0], 3), np.uint8)
    for k, finger in enumerate(fingers):
        image = (state.images or {}).get(finger)
        left = k * _WIDTH
        said = finger if image is not None else f"{finger}: no picture"
        cv2.putText(canvas, said, (left + 8, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.55, _LIGHT, 1, cv2.LINE_AA)
        if image is not None:
            canvas[_LINE:, left : left + _WIDTH] = cv2.resize(image.frame, (_WIDTH, _HEIGHT))
    if not fingers:
        for k, (name, text) in enumerate(state.rows.items()):
            place = (8, 60 + 34 * k)
            cv2.putText(
                canvas, f"{name}: {text}", place, cv2.FONT_HERSHEY_SIMPLEX, 0.7, _LIGHT, 1, cv2.LINE_AA
            )
    return canvas
