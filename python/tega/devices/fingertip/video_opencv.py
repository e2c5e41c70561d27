"""Read the frames of a video file with OpenCV, where PyAV is not installed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tega.errors import RecordingError
from tega.runtime.files.video import VideoFacts, check_video
from tega.runtime.opencv import load_cv2

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Containers that state no number of frames: OpenCV computes it from the duration, which may be off by one.
_INFERRED_COUNT_SUFFIXES: Final = frozenset({".mkv", ".webm", ".ts", ".mpg", ".mpeg", ".flv"})


class OpenCvFrames:
    """The frames of a video file, frame k at k/rate, not turned.

    Otherwise as :class:`tega.runtime.files.video.VideoFrames`.

    Raises:
        RecordingError: The file is no video, states no rate or length, or nothing of it decodes.
        MissingExtraError: OpenCV is not installed either.
    """

    def __init__(self, path: Path) -> None:
        cv2 = load_cv2("video")
        check_video(path)
        self._path = path
        self._capture: Any = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG, [cv2.CAP_PROP_N_THREADS, 1])
        if not self._capture.isOpened():
            self._refuse(f"cannot be opened as a video ({path.stat().st_size} bytes)")
        self._capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
        rate_hz = float(self._capture.get(cv2.CAP_PROP_FPS))
        n_stated = float(self._capture.get(cv2.CAP_PROP_FRAME_COUNT))
        if not (0 < rate_hz <= 100_000 and 1 <= n_stated < 2**40):
            self._refuse(f"its header states {rate_hz:g} frames per second and {n_stated:g} frames")
        n = int(n_stated)
        self.facts = VideoFacts(
            "", n, n, rate_hz, 1 / rate_hz, variable=False, cut=False, end_s=None, times_s=None
        )
        self.notes = [
            f"{path.name}: read by OpenCV, since PyAV is not installed: frame k is taken at k/rate; a variable frame "
            "rate or a rotation tag is ignored; pip install 'tega[lab]'"
        ]
        self.n_decoded = 0
        self._pending: NDArray[np.uint8] | None = None
        self._decode()
        if self._pending is None:
            self._refuse(f"none of its {n} frames can be decoded by OpenCV")

    @property
    def ended(self) -> bool:
        """Whether all frames were read."""
        return self._pending is None

    def close(self) -> None:
        """Close the file."""
        self._capture.release()

    def skip(self, n_frames: int) -> None:
        """Pass over frames."""
        for _ in range(n_frames):
            self._decode()

    def read(self) -> tuple[float, NDArray[np.uint8]] | None:
        """Return the next frame and its time, seconds; ``None`` after the last."""
        image, t_s = self._pending, (self.n_decoded - 1) / self.facts.rate_hz
        if image is None:
            return None
        self._decode()
        return t_s, image

    def fault(self) -> str:
        """Return how the number of frames that decode differs from the header's; ``""`` if it does not."""
        n, slack = self.facts.n_frames, int(self._path.suffix.lower() in _INFERRED_COUNT_SUFFIXES)
        if self.n_decoded >= n - slack:
            return ""
        return (
            f"{self._path.name}: {self.n_decoded} frames decode, its header says {n}: the video was cut short"
        )

    def _decode(self) -> None:
        decoded, image = self._capture.read()
        self._pending = np.asarray(image, np.uint8) if decoded else None
        self.n_decoded += bool(decoded)

    def _refuse(self, why: str) -> None:
        self.close()
        raise RecordingError(f"{self._path.name}: {why}", "install PyAV: pip install 'tega[lab]'")
