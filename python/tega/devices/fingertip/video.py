"""Read the pictures of a fingertip from a video file."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from tega.devices.base import Options, TactileFrame
from tega.devices.fingertip.images import RecordedPictures
from tega.errors import RecordingError
from tega.runtime.files.video import VideoFrames
from tega.runtime.opencv import IMAGE_SUFFIXES


class VideoFileOptions(Options, frozen=True):
    """Settings of :class:`VideoFile`.

    Attributes:
        file: The video; it states times, rate and number of its frames.
        allow_truncated: If true, accept a video with a length that differs from its header.
    """

    file: Path
    allow_truncated: bool = False


class VideoFile(RecordedPictures):
    """The frames of a video, each at its own time, turned by the rotation tag.

    If the frames that decode are not those that the header states, the file is damaged or was cut: it is
    refused, or, if allowed, used without the last frame decoded, which may be half a picture.
    """

    name: ClassVar[str] = "video"
    summary: ClassVar[str] = "a video file, with its own frame times"
    extra: ClassVar[str] = "lab"
    requires: ClassVar[tuple[str, ...]] = ("av",)
    options_type: ClassVar[type[Options]] = VideoFileOptions
    _reader: VideoFrames | None

    def __init__(self, options: VideoFileOptions) -> None:
        super().__init__(options.file.name)
        self._options = options
        self._cut = False

    def open(self) -> None:
        """Open the file, and decode the first frame; ``RecordingError`` also if it states no rate."""
        self.close()
        path = self._options.file
        if path.suffix.lower() in IMAGE_SUFFIXES and path.exists():
            raise RecordingError(
                f"{path.name}: a picture, not a video", "give the folder that holds the pictures"
            )
        self._reader = frames = VideoFrames(path)
        self._rate_hz, self._notes, self._cut = frames.facts.rate_hz, frames.notes, False
        self._begin(frames.facts.n_frames)

    @property
    def ended(self) -> bool:
        """Whether all frames were read."""
        return self._reader is not None and (self._cut or self._reader.ended)

    def read(self, timeout_s: float) -> TactileFrame | None:  # noqa: ARG002  # a file never keeps one waiting
        """Return the next frame.

        ``RecordingError``: a frame's size is not the first's, or the file was cut and that is not allowed.
        """
        frames = self._reader
        if frames is None:
            raise self._closed()
        if self._cut or (found := frames.read()) is None:
            return None
        t_s, image = found
        name = f"{self._label} frame {self._seq}"
        frame = self._frame(self._seq, round(t_s * 1e9), image, name, "cut the video there")
        if frames.ended:
            self._n_pictures = frames.n_decoded
            if fault := frames.fault():
                self._end_early(fault)
                return None
        self._seq += 1
        return frame

    def _end_early(self, fault: str) -> None:
        """Refuse a file that was cut, or note it and leave out the last frame decoded."""
        if not self._options.allow_truncated:
            raise RecordingError(
                fault, "export it again, or allow it with --allow-truncated (allow_truncated = true)"
            )
        self._cut, self._n_pictures = True, self._seq
        self._notes.append(f"{fault}; {self._seq} were used, the last one decoded may be incomplete")
