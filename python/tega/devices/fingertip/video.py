"""Read the pictures of a fingertip from a video file."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from tega.devices.base import DeviceInfo, Kind, Options, TactileFrame
from tega.errors import DeviceUnavailableError, RecordingError
from tega.runtime.files.foreign_file import check_file
from tega.runtime.lifecycle import Opened
from tega.runtime.opencv import IMAGE_SUFFIXES, load_cv2

# Containers that state no frame count leave OpenCV to infer it from the duration, which may be off by one.
_INFERRED_COUNT_SUFFIXES = frozenset({".mkv", ".webm", ".ts", ".mpg", ".mpeg", ".flv"})


# A day of one camera's video, little compressed.
_MOST_MIB = 256 * 1024


class VideoFileOptions(Options, frozen=True):
    """Settings of :class:`VideoFile`.

    Attributes:
        file: The video; its header gives rate and number of frames.
        allow_truncated: Use a video that ends before its header says, instead of refusing it.
    """

    file: Path
    allow_truncated: bool = False


class VideoFile(Opened):
    """The frames of a video, frame k at k/rate, rate and length as its header says.

    The length is checked: when fewer frames can be decoded than the header announces, the file was cut. It is
    then refused, or, when asked for, used without the last frame decoded, since that may be half a picture.
    """

    kind: ClassVar[Kind] = "tactile"
    summary: ClassVar[str] = "a video file, at the rate its header states"
    extra: ClassVar[str] = "lab"
    requires: ClassVar[tuple[str, ...]] = ("cv2",)
    options_type: ClassVar[type[Options]] = VideoFileOptions

    def __init__(self, options: VideoFileOptions) -> None:
        self._options = options
        self._capture: Any = None
        self._rate_hz: float | None = None
        self._announced: int | None = None
        self._decoded = 0
        self._pending: np.ndarray[Any, np.dtype[np.uint8]] | None = None
        self._notes: tuple[str, ...] = ()

    @property
    def info(self) -> DeviceInfo:
        """Name and, once open, rate and number of frames."""
        return DeviceInfo(
            driver="video",
            kind="tactile",
            label=self._options.file.name,
            live=False,
            rate_hz=self._rate_hz,
            unit="counts of 255",
            n_items=self._announced,
            notes=self._notes,
        )

    def open(self) -> None:
        """Open the file and read its header.

        Raises:
            RecordingError: It is missing, is no video, or its header states no rate or length.
            MissingExtraError: OpenCV is not installed.
        """
        self.close()
        path = self._options.file
        cv2 = load_cv2("video")
        if not path.exists() or path.is_dir():
            raise RecordingError(f"{path.name}: no such video file", f"looked for {path}")
        check_file(path, most_mib=_MOST_MIB)
        if path.suffix.lower() in IMAGE_SUFFIXES:
            raise RecordingError(
                f"{path.name}: a picture, not a video", "give the folder that holds the pictures"
            )
        capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG, [cv2.CAP_PROP_N_THREADS, 1])
        if not capture.isOpened():
            capture.release()
            raise RecordingError(
                f"{path.name}: cannot be opened as a video ({path.stat().st_size} bytes)",
                "it may be cut short (an MP4 keeps its table at the end) or not a video; export it again",
            )
        capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
        rate_hz = float(capture.get(cv2.CAP_PROP_FPS))
        announced = float(capture.get(cv2.CAP_PROP_FRAME_COUNT))
        if not (0 < rate_hz <= 100_000 and 1 <= announced < 2**40):
            capture.release()
            raise RecordingError(
                f"{path.name}: its header states {rate_hz:g} frames per second and {announced:g} frames",
                "export it with a proper header, or as a folder of pictures with a stated rate",
            )
        self._capture, self._rate_hz, self._announced = capture, rate_hz, int(announced)
        self._decoded, self._notes = 0, ()
        self._pending = self._decode()

    def close(self) -> None:
        """Close the file."""
        if self._capture is not None:
            self._capture.release()
        self._capture = None
        self._pending = None

    @property
    def ended(self) -> bool:
        """Whether all frames were read."""
        return self._capture is not None and self._pending is None

    def skip(self, n_frames: int) -> None:
        """Pass over frames without converting them."""
        for _ in range(n_frames - 1):
            if self._pending is None:
                return
            if self._capture.grab():
                self._decoded += 1
            else:
                self._pending = None
        if n_frames > 0 and self._pending is not None:
            self._pending = self._decode()

    def read(self, timeout_s: float) -> TactileFrame | None:  # noqa: ARG002  # a file never keeps one waiting
        """Return the next frame.

        Raises:
            RecordingError: The video ends before its header says, and that is not allowed.
            DeviceUnavailableError: The source is not open.
        """
        if self._capture is None or self._rate_hz is None:
            raise DeviceUnavailableError(f"video {self._options.file.name!r} is not open", "open it first")
        image, seq = self._pending, self._decoded - 1
        if image is None:
            return None
        self._pending = self._decode()
        if self._pending is None and self._is_cut():
            return None
        name = f"{self._options.file.name} frame {seq}"
        return TactileFrame(round(seq * 1_000_000_000 / self._rate_hz), seq, image, name)

    def _decode(self) -> np.ndarray[Any, np.dtype[np.uint8]] | None:
        ok, image = self._capture.read()
        if not ok:
            return None
        self._decoded += 1
        return np.asarray(image, np.uint8)

    def _is_cut(self) -> bool:
        path = self._options.file
        announced = self._announced or 0
        slack = 1 if path.suffix.lower() in _INFERRED_COUNT_SUFFIXES else 0
        if self._decoded >= announced - slack:
            return False
        said = f"{path.name}: {self._decoded} frames decode, its header says {announced}: the video was cut short"
        if not self._options.allow_truncated:
            raise RecordingError(
                said, "export it again, or allow it with --allow-truncated (allow_truncated = true)"
            )
        used = max(self._decoded - 1, 0)
        self._notes = (f"{said}; {used} were used, the last one decoded may be incomplete",)
        self._announced = used
        return True
