"""Read the pictures of a fingertip from a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, ClassVar

import msgspec
import numpy as np

from tega.devices.base import DeviceInfo, Kind, Options, TactileFrame
from tega.errors import DeviceUnavailableError, RecordingError
from tega.runtime.files.picture_names import name_times_s, sorted_names, without_strays
from tega.runtime.lifecycle import Opened
from tega.runtime.opencv import IMAGE_SUFFIXES, load_cv2, read_image

_USUAL_HZ = 60.0


class ImageFolderOptions(Options, frozen=True):
    """Settings of :class:`ImageFolder`.

    Attributes:
        folder: The folder; its sub-folders are not read.
        rate_hz: Pictures per second. By default the times in the names count where they are seconds, milliseconds,
            microseconds or nanoseconds since 1970; else 60.
        exclude: Files in it that are no frames, such as the baseline.
    """

    folder: Path
    rate_hz: Annotated[float, msgspec.Meta(gt=0, le=100_000)] | None = None
    exclude: tuple[Path, ...] = ()


class ImageFolder(Opened):
    """The pictures of a folder by the numbers in their names, frame k at k/rate or at the time in its name.

    Other files are ignored, hidden ones too, and so is a picture named unlike nearly all others; a note says which.
    All pictures have to have the size of the first. A folder without pictures may hold ``.npy`` arrays, one a picture.
    """

    kind: ClassVar[Kind] = "tactile"
    summary: ClassVar[str] = "a folder of pictures, in the order of the numbers in their names"
    extra: ClassVar[str] = "lab"
    requires: ClassVar[tuple[str, ...]] = ("cv2",)
    options_type: ClassVar[type[Options]] = ImageFolderOptions

    def __init__(self, options: ImageFolderOptions) -> None:
        self._options = options
        self._files: list[Path] | None = None
        self._next = 0
        self._notes: tuple[str, ...] = ()
        self._shape: tuple[int, ...] | None = None
        self._times_s: list[float] | None = None
        self._rate_hz = options.rate_hz or _USUAL_HZ

    @property
    def info(self) -> DeviceInfo:
        """Name, rate and, once open, the number of pictures."""
        return DeviceInfo(
            driver="images",
            kind="tactile",
            label=self._options.folder.name,
            live=False,
            rate_hz=self._rate_hz,
            unit="counts of 255",
            n_items=None if self._files is None else len(self._files),
            notes=self._notes,
        )

    def open(self) -> None:
        """List the folder.

        Raises:
            RecordingError: It is no folder, or holds no picture.
            MissingExtraError: OpenCV is not installed.
        """
        folder = self._options.folder
        load_cv2("images")
        if not folder.is_dir():
            raise RecordingError(
                f"{folder.name}: no such folder of pictures",
                f"looked for {folder}; give a folder or a video file",
            )
        excluded = {path.resolve() for path in self._options.exclude}
        there = [
            path
            for path in folder.iterdir()
            if not path.name.startswith(".") and path.is_file() and path.resolve() not in excluded
        ]
        files = [path for path in there if path.suffix.lower() in IMAGE_SUFFIXES]
        files = files or [path for path in there if path.suffix.lower() == ".npy"]
        if not files:
            raise RecordingError(
                f"{folder.name}: holds no picture that is a frame",
                f"frames are files ending in {', '.join(sorted(IMAGE_SUFFIXES))}, the baseline apart",
            )
        files, self._notes = without_strays(files)
        self._files = sorted_names(files)
        self._use_names([path.stem for path in self._files])
        self._next = 0
        self._shape = None

    def close(self) -> None:
        """Forget the listing."""
        self._files = None

    @property
    def ended(self) -> bool:
        """Whether all pictures were read."""
        return self._files is not None and self._next >= len(self._files)

    def skip(self, n_frames: int) -> None:
        """Pass over pictures without reading them."""
        self._next += n_frames

    def read(self, timeout_s: float) -> TactileFrame | None:  # noqa: ARG002  # a file never keeps one waiting
        """Return the next picture.

        Raises:
            RecordingError: It is cut short, unreadable, or not of the first one's size.
            DeviceUnavailableError: The source is not open.
        """
        if self._files is None:
            raise DeviceUnavailableError(f"images {self._options.folder.name!r} is not open", "open it first")
        if self.ended:
            return None
        seq = self._next
        self._next += 1
        path = self._files[seq]
        image = read_image(path, driver="images")
        self._shape = self._shape or image.shape
        if image.shape != self._shape:
            raise RecordingError(
                f"{path.name}: {image.shape[1]}×{image.shape[0]} pixels, the frames before it have "
                f"{self._shape[1]}×{self._shape[0]}",
                "a recording has one size; take the file out of the folder or name it as the baseline",
            )
        t_s = seq / self._rate_hz if self._times_s is None else self._times_s[seq]
        return TactileFrame(round(t_s * 1e9), seq, image, path.name)

    def _use_names(self, stems: list[str]) -> None:
        """Take the times in the names where there are some, or note that a given rate differs from them."""
        given_hz, times_s = self._options.rate_hz, name_times_s(stems)
        self._times_s, self._rate_hz = None, given_hz or _USUAL_HZ
        if times_s is None:
            return
        mean_hz = (len(times_s) - 1) / times_s[-1]
        if given_hz is None:
            self._times_s, self._rate_hz = times_s, mean_hz
            longest_s = float(np.diff(times_s).max())
            self._notes += (
                f"the names state the times: {mean_hz:.4g} pictures per second, at most {longest_s:.3g} s apart",
            )
        elif abs(mean_hz - given_hz) > 0.01 * given_hz:
            self._notes += (
                f"the names state {mean_hz:.4g} pictures per second, {given_hz:g} is used; leave rate_hz out to use "
                "theirs",
            )
