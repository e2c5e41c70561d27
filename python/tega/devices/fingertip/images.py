"""Give the pictures of a recording in their order, and read those of a folder; other drivers add files and bags."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, ClassVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.devices.base import DeviceInfo, Kind, Options, TactileFrame
from tega.errors import DeviceUnavailableError, RecordingError
from tega.runtime.files.picture_stack import PictureStack, name_times_s, sorted_names, without_strays
from tega.runtime.files.video import VideoFrames
from tega.runtime.lifecycle import Opened
from tega.runtime.opencv import IMAGE_SUFFIXES, load_cv2, read_image

_USUAL_HZ = 60.0


class RecordedPictures(Opened):
    """Pictures of one size, numbered from 0, of a file or folder ``label``.

    ``rate_hz`` is pictures per second as far as known; a driver updates it when it is opened.
    """

    kind: ClassVar[Kind] = "tactile"
    name: ClassVar[str]

    def __init__(self, label: str, rate_hz: float | None = None) -> None:
        self._label, self._rate_hz = label, rate_hz
        self._reader: PictureStack | VideoFrames | None = None
        self._n_pictures: int | None = None
        self._notes: list[str] = []
        self._seq = 0
        self._shape: tuple[int, ...] = ()

    @property
    def info(self) -> DeviceInfo:
        """Name and, once open, rate and number of pictures."""
        return DeviceInfo(
            driver=self.name,
            kind="tactile",
            label=self._label,
            live=False,
            rate_hz=self._rate_hz,
            unit="counts of 255",
            n_items=self._n_pictures,
            notes=tuple(self._notes),
        )

    def _begin(self, n_pictures: int | None) -> None:
        self._n_pictures, self._seq, self._shape = n_pictures, 0, ()

    @property
    def ended(self) -> bool:
        """Whether all pictures were read."""
        return self._n_pictures is not None and self._seq >= self._n_pictures

    def close(self) -> None:
        """Close the recording."""
        if self._reader is not None:
            self._reader.close()
        self._reader = self._n_pictures = None

    def skip(self, n_frames: int) -> None:
        """Pass over pictures without converting their pixels."""
        if self._reader is not None:
            self._reader.skip(n_frames)
        self._seq += n_frames

    def _at_ns(self, seq: int, times_s: list[float] | None) -> int:
        """Return the time of a picture by its number, or by the times that the recording states."""
        return round((seq / (self._rate_hz or 1.0) if times_s is None else times_s[seq]) * 1e9)

    def _frame(self, seq: int, t_ns: int, image: NDArray[np.uint8], name: str, cut: str) -> TactileFrame:
        """Return a frame; refuse one of another size than the first; the error names what to cut."""
        self._shape = self._shape or image.shape
        if image.shape != self._shape:
            raise RecordingError(
                f"{name}: {image.shape[1]}×{image.shape[0]} pixels, the frames before it have "
                f"{self._shape[1]}×{self._shape[0]}",
                f"a recording has one size; {cut}",
            )
        return TactileFrame(t_ns, seq, image, name)

    def _closed(self) -> DeviceUnavailableError:
        return DeviceUnavailableError(f"{self.name} {self._label!r} is not open", "open it first")


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


class ImageFolder(RecordedPictures):
    """Pictures of a folder by the numbers in their names, frame k at k/rate or at the time in its name.

    Other and hidden files are ignored; so is a picture named unlike nearly all others, with a note. All
    pictures must have the size of the first. A folder without pictures may hold ``.npy`` arrays, one a
    picture.
    """

    name: ClassVar[str] = "images"
    summary: ClassVar[str] = "a folder of pictures, in the order of the numbers in their names"
    extra: ClassVar[str] = "lab"
    requires: ClassVar[tuple[str, ...]] = ("cv2",)
    options_type: ClassVar[type[Options]] = ImageFolderOptions

    def __init__(self, options: ImageFolderOptions) -> None:
        super().__init__(options.folder.name, options.rate_hz or _USUAL_HZ)
        self._options = options
        self._files: list[Path] | None = None
        self._times_s: list[float] | None = None

    def open(self) -> None:
        """List the folder; ``RecordingError`` if it holds no picture."""
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
        files, notes = without_strays(files)
        self._files, self._notes = sorted_names(files), list(notes)
        self._use_names([path.stem for path in self._files])
        self._begin(len(files))

    def close(self) -> None:
        """Forget the listing."""
        super().close()
        self._files = None

    def read(self, timeout_s: float) -> TactileFrame | None:  # noqa: ARG002  # a file never keeps one waiting
        """Return the next picture; ``RecordingError`` if it is damaged or not of the first one's size."""
        if self._files is None:
            raise self._closed()
        if self.ended:
            return None
        seq, cut = self._seq, "take the file out of the folder or name it as the baseline"
        path = self._files[seq]
        self._seq += 1
        image = read_image(path, driver=self.name)
        return self._frame(seq, self._at_ns(seq, self._times_s), image, path.name, cut)

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
            self._notes.append(
                f"the names state the times: {mean_hz:.4g} pictures per second, at most {longest_s:.3g} s apart"
            )
        elif abs(mean_hz - given_hz) > 0.01 * given_hz:
            self._notes.append(
                f"the names state {mean_hz:.4g} pictures per second, {given_hz:g} is used; leave rate_hz out to use "
                "theirs"
            )
