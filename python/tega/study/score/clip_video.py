"""Write a recorded trial as a video of its fingertips, every picture whole, so that it can be stepped through.

Pictures, or on the simulated bench, which has none, lines of the object's truth; nothing of the vest, no measure of
touch and no muscle signal.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError
from tega.lifecycle import require
from tega.study.score.recorded import RecordedTrial
from tega.study.score.trial_pictures import Reel, read_reel

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
    size = (_WIDTH * max(len(reel.fingers), 2), _HEIGHT + _LINE)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), RATE_HZ, size)
    try:
        if not writer.isOpened():
            raise RecordingError(f"{path}: the video cannot be written", "is the folder writable?")
        for k in range(n_pictures):
            writer.write(_picture(cv2, reel, round(k / RATE_HZ * 1e9), size))
    finally:
        writer.release()
    return n_pictures / RATE_HZ


def _picture(cv2: Any, reel: Reel, at_ns: int, size: tuple[int, int]) -> NDArray[np.uint8]:
    canvas = np.zeros((size[1], size[0], 3), np.uint8)

    def say(text: str, place: tuple[int, int], scale: float) -> None:
        cv2.putText(canvas, text, place, cv2.FONT_HERSHEY_SIMPLEX, scale, _LIGHT, 1, cv2.LINE_AA)

    for k, finger in enumerate(reel.fingers):
        frame, left = reel.picture(finger, at_ns), k * _WIDTH
        say(finger if frame is not None else f"{finger}: no picture", (left + 8, 20), 0.55)
        if frame is not None:
            canvas[_LINE:, left : left + _WIDTH] = cv2.resize(frame, (_WIDTH, _HEIGHT))
    for k, line in enumerate(reel.lines(at_ns)):
        say(line, (8, 60 + 34 * k), 0.7)
    return canvas
