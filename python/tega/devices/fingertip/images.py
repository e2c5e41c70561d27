"""Read the pictures of a fingertip from a folder."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path
from typing import Annotated, ClassVar

import msgspec

from tega.devices.base import DeviceInfo, Kind, Options, TactileFrame
from tega.errors import DeviceUnavailableError, RecordingError
from tega.runtime.lifecycle import Opened
from tega.runtime.opencv import IMAGE_SUFFIXES, load_cv2, read_image

# So few pictures with names of another kind are no part of the recording.
_STRAY_SHARE = 0.1


class ImageFolderOptions(Options, frozen=True):
    """Settings of :class:`ImageFolder`.

    Attributes:
        folder: The folder; its sub-folders are not looked into.
        rate_hz: Pictures per second they were taken with.
        exclude: Files in it that are no frames, such as the baseline.
    """

    folder: Path
    rate_hz: Annotated[float, msgspec.Meta(gt=0, le=100_000)] = 60.0
    exclude: tuple[Path, ...] = ()


class ImageFolder(Opened):
    """The pictures of a folder in natural order (``frame_2`` before ``frame_10``), frame k at k/rate.

    Other files are ignored, hidden ones too, and so is a picture named unlike nearly all others; a note says which.
    All pictures have to have the size of the first.
    """

    kind: ClassVar[Kind] = "tactile"
    summary: ClassVar[str] = "a folder of pictures, in natural order, at a stated rate"
    extra: ClassVar[str] = "lab"
    requires: ClassVar[tuple[str, ...]] = ("cv2",)
    options_type: ClassVar[type[Options]] = ImageFolderOptions

    def __init__(self, options: ImageFolderOptions) -> None:
        self._options = options
        self._files: list[Path] | None = None
        self._next = 0
        self._notes: tuple[str, ...] = ()
        self._shape: tuple[int, ...] | None = None

    @property
    def info(self) -> DeviceInfo:
        """Name, rate and, once open, the number of pictures."""
        return DeviceInfo(
            driver="images",
            kind="tactile",
            label=self._options.folder.name,
            live=False,
            rate_hz=self._options.rate_hz,
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
        files = [
            path
            for path in folder.iterdir()
            if path.suffix.lower() in IMAGE_SUFFIXES
            and not path.name.startswith(".")
            and path.is_file()
            and path.resolve() not in excluded
        ]
        if not files:
            raise RecordingError(
                f"{folder.name}: holds no picture that is a frame",
                f"frames are files ending in {', '.join(sorted(IMAGE_SUFFIXES))}, the baseline apart",
            )
        files, self._notes = _without_strays(files)
        self._files = sorted(files, key=lambda path: _natural(path.name))
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
        return TactileFrame(round(seq * 1_000_000_000 / self._options.rate_hz), seq, image, path.name)


def _without_strays(files: list[Path]) -> tuple[list[Path], tuple[str, ...]]:
    """Leave out pictures named unlike nearly all others, and say so: as frames they would set the maximum."""
    shapes = {path: re.sub("[0-9]+", "#", path.stem.casefold()) for path in files}
    usual, n_usual = Counter(shapes.values()).most_common(1)[0]
    if n_usual == len(files) or len(files) - n_usual > _STRAY_SHARE * len(files):
        return files, ()
    strays = sorted(path.name for path, shape in shapes.items() if shape != usual)
    return [path for path, shape in shapes.items() if shape == usual], (
        f"{', '.join(strays[:3])}{' and others' if len(strays) > 3 else ''}: not named as the {n_usual} other pictures "
        f"({usual}), so no frame and not used; rename what is one",
    )


def _natural(name: str) -> list[tuple[int, int, str]]:
    """Sort key under which numbers inside a name count as numbers."""
    parts = re.split(r"([0-9]+)", name)
    key = [(0, int(part), "") if i % 2 else (1, 0, part.casefold()) for i, part in enumerate(parts)]
    # Equal but for case or leading zeros: the name itself decides, so that the order never depends on the disk.
    return [*key, (2, 0, name)]
