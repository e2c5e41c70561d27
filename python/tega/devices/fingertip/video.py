"""Read the pictures of a fingertip from a video file."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import ClassVar

from tega.devices.base import DeviceInfo, Kind, Options, TactileFrame
from tega.devices.fingertip.video_opencv import OpenCvFrames
from tega.errors import DeviceUnavailableError, RecordingError
from tega.runtime.files.video import VideoFrames
from tega.runtime.lifecycle import Opened
from tega.runtime.opencv import IMAGE_SUFFIXES


class VideoFileOptions(Options, frozen=True):
    """Settings of :class:`VideoFile`.

    Attributes:
        file: The video; it states times, rate and number of its frames.
        allow_truncated: If true, accept a video with a length that differs from its header.
    """

    file: Path
    allow_truncated: bool = False


class VideoFile(Opened):
    """The frames of a video, each at its own time, turned by the rotation tag.

    Where the frames that decode are not those that the header states, the file is damaged or was cut. It is then
    refused, or, if allowed, used without the last frame decoded, which may be half a picture.
    """

    kind: ClassVar[Kind] = "tactile"
    summary: ClassVar[str] = "a video file, with its own frame times"
    extra: ClassVar[str] = "lab"
    requires: ClassVar[tuple[str, ...]] = ("av",)
    options_type: ClassVar[type[Options]] = VideoFileOptions

    def __init__(self, options: VideoFileOptions) -> None:
        self._options = options
        self._frames: VideoFrames | OpenCvFrames | None = None
        self._rate_hz: float | None = None
        self._n_frames: int | None = None
        self._shape: tuple[int, ...] = ()
        self._seq = 0
        self._cut = False
        self._notes: list[str] = []

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
            n_items=self._n_frames,
            notes=tuple(self._notes),
        )

    def open(self) -> None:
        """Open the file, and decode the first frame.

        Raises:
            RecordingError: It is missing, is no video, states no rate, or nothing of it decodes.
            MissingExtraError: Neither PyAV nor OpenCV is installed.
        """
        self.close()
        path = self._options.file
        if path.suffix.lower() in IMAGE_SUFFIXES and path.exists():
            raise RecordingError(
                f"{path.name}: a picture, not a video", "give the folder that holds the pictures"
            )
        decode = OpenCvFrames if importlib.util.find_spec("av") is None else VideoFrames
        self._frames = frames = decode(path)
        self._rate_hz, self._n_frames = frames.facts.rate_hz, frames.facts.n_frames
        self._notes, self._shape, self._seq, self._cut = frames.notes, (), 0, False

    def close(self) -> None:
        """Close the file."""
        if self._frames is not None:
            self._frames.close()
        self._frames = None

    @property
    def ended(self) -> bool:
        """Whether all frames were read."""
        return self._frames is not None and (self._cut or self._frames.ended)

    def skip(self, n_frames: int) -> None:
        """Pass over frames without converting them."""
        if self._frames is not None:
            self._frames.skip(n_frames)
            self._seq += n_frames

    def read(self, timeout_s: float) -> TactileFrame | None:  # noqa: ARG002  # a file never keeps one waiting
        """Return the next frame.

        Raises:
            RecordingError: The frames are not those that the header states, and that is not allowed; or a frame has
                another size than the first.
            DeviceUnavailableError: The source is not open.
        """
        frames, path = self._frames, self._options.file
        if frames is None:
            raise DeviceUnavailableError(f"video {path.name!r} is not open", "open it first")
        if self._cut or (found := frames.read()) is None:
            return None
        t_s, image = found
        name, seq = f"{path.name} frame {self._seq}", self._seq
        self._shape = self._shape or image.shape
        if image.shape != self._shape:
            raise RecordingError(
                f"{name}: {image.shape[1]}×{image.shape[0]} pixels, the frames before it have "
                f"{self._shape[1]}×{self._shape[0]}",
                "a recording has one size; cut the video there",
            )
        if frames.ended:
            self._n_frames = frames.n_decoded
            if fault := frames.fault():
                self._end_early(fault)
                return None
        self._seq += 1
        return TactileFrame(round(t_s * 1e9), seq, image, name)

    def _end_early(self, fault: str) -> None:
        """Refuse a file that was cut, or note it and leave out the last frame decoded."""
        if not self._options.allow_truncated:
            raise RecordingError(
                fault, "export it again, or allow it with --allow-truncated (allow_truncated = true)"
            )
        self._cut, self._n_frames = True, self._seq
        self._notes.append(f"{fault}; {self._seq} were used, the last one decoded may be incomplete")
