"""Read the pictures of a fingertip from one array in a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, ClassVar, Literal

import msgspec
import numpy as np

from tega.devices.base import Options, TactileFrame
from tega.devices.fingertip.images import RecordedPictures
from tega.runtime.files.picture_stack import PictureStack


class StackFileOptions(Options, frozen=True):
    """Settings of :class:`StackFile`.

    Attributes:
        file: An ``.npy`` or ``.npz`` file, uint8 (n, H, W, 3) or grey (n, H, W).
        rate_hz: Pictures per second. By default an array ``t_s`` or ``t_ns`` beside them counts; else 60.
        variable: Name of the array in an ``.npz`` file; by default the only one that holds pictures.
        order: Order of the colours: blue, green, red as OpenCV has it, or red, green, blue.
    """

    file: Path
    rate_hz: Annotated[float, msgspec.Meta(gt=0, le=100_000)] | None = None
    variable: str = ""
    order: Literal["bgr", "rgb"] = "bgr"


class StackFile(RecordedPictures):
    """The pictures of an array, picture k at k/rate or at its own time."""

    name: ClassVar[str] = "picture-stack"
    summary: ClassVar[str] = "a stack of pictures in an .npy or .npz file"
    options_type: ClassVar[type[Options]] = StackFileOptions
    _reader: PictureStack | None

    def __init__(self, options: StackFileOptions) -> None:
        super().__init__(options.file.name, options.rate_hz or 60.0)
        self._options = options
        self._times_s: list[float] | None = None

    def open(self) -> None:
        """Open the file; ``RecordingError`` if it holds no stack of pictures."""
        self.close()
        self._reader = stack = PictureStack(self._options.file, variable=self._options.variable)
        self._begin(stack.n_pictures)
        self._times_s = None if self._options.rate_hz else stack.times_s
        if self._times_s is not None and len(self._times_s) > 1:
            self._rate_hz = (len(self._times_s) - 1) / self._times_s[-1]

    def read(self, timeout_s: float) -> TactileFrame | None:  # noqa: ARG002  # a file never keeps one waiting
        """Return the next picture; ``RecordingError`` if the file is damaged."""
        if self._reader is None:
            raise self._closed()
        image, seq = self._reader.read(), self._seq
        if image is None:
            return None
        self._seq += 1
        if self._options.order == "rgb":
            image = np.ascontiguousarray(image[..., ::-1])
        return TactileFrame(self._at_ns(seq, self._times_s), seq, image, f"{self._label} picture {seq}")
