"""Read the pictures of a fingertip from one array in a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, ClassVar, Literal

import msgspec
import numpy as np

from tega.devices.base import DeviceInfo, Kind, Options, TactileFrame
from tega.errors import DeviceUnavailableError
from tega.runtime.files.picture_stack import PictureStack
from tega.runtime.lifecycle import Opened


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


class StackFile(Opened):
    """The pictures of an array, picture k at k/rate or at its own time."""

    kind: ClassVar[Kind] = "tactile"
    summary: ClassVar[str] = "a stack of pictures in an .npy or .npz file"
    extra: ClassVar[str] = ""
    requires: ClassVar[tuple[str, ...]] = ()
    options_type: ClassVar[type[Options]] = StackFileOptions

    def __init__(self, options: StackFileOptions) -> None:
        self._options = options
        self._stack: PictureStack | None = None
        self._times_s: list[float] | None = None
        self._rate_hz = options.rate_hz or 60.0
        self._seq = 0

    @property
    def info(self) -> DeviceInfo:
        """Name, rate and, once open, the number of pictures."""
        return DeviceInfo(
            driver="picture-stack",
            kind="tactile",
            label=self._options.file.name,
            live=False,
            rate_hz=self._rate_hz,
            unit="counts of 255",
            n_items=None if self._stack is None else self._stack.n_pictures,
        )

    def open(self) -> None:
        """Open the file.

        Raises:
            RecordingError: It is missing, or holds no stack of pictures.
        """
        self.close()
        self._stack = stack = PictureStack(self._options.file, variable=self._options.variable)
        self._seq, self._times_s = 0, None if self._options.rate_hz else stack.times_s
        if self._times_s is not None and len(self._times_s) > 1:
            self._rate_hz = (len(self._times_s) - 1) / self._times_s[-1]

    def close(self) -> None:
        """Close the file."""
        if self._stack is not None:
            self._stack.close()
        self._stack = None

    @property
    def ended(self) -> bool:
        """Whether all pictures were read."""
        return self._stack is not None and self._seq >= self._stack.n_pictures

    def skip(self, n_frames: int) -> None:
        """Pass over pictures."""
        if self._stack is not None:
            self._stack.skip(n_frames)
            self._seq += n_frames

    def read(self, timeout_s: float) -> TactileFrame | None:  # noqa: ARG002  # a file never keeps one waiting
        """Return the next picture.

        Raises:
            RecordingError: The file is damaged.
            DeviceUnavailableError: The source is not open.
        """
        if self._stack is None:
            raise DeviceUnavailableError(f"stack {self._options.file.name!r} is not open", "open it first")
        image = self._stack.read()
        if image is None:
            return None
        seq = self._seq
        self._seq += 1
        if self._options.order == "rgb":
            image = np.ascontiguousarray(image[..., ::-1])
        t_s = seq / self._rate_hz if self._times_s is None else self._times_s[seq]
        return TactileFrame(round(t_s * 1e9), seq, image, f"{self._options.file.name} picture {seq}")
