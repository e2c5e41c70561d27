"""Read a recorded EMG signal from a file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

import msgspec

from tega.devices.base import DeviceInfo, EmgChunk, Kind, Options
from tega.devices.emg.emg_formats import read_emg_file
from tega.errors import DeviceUnavailableError
from tega.runtime.lifecycle import Opened

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


_CHUNK_S = 0.1


class EmgFileOptions(Options, frozen=True):
    """Settings of :class:`EmgFile`.

    Attributes:
        file: A ``.mat``, ``.npy`` or text file, one row per sample.
        rate_hz: Samples per second it was taken with.
        channels: Which columns to use, counted from 1; none means all.
        variable: Name of the array in a ``.mat`` file.
    """

    file: Path
    rate_hz: Annotated[float, msgspec.Meta(gt=0, le=10_000_000)]
    channels: tuple[Annotated[int, msgspec.Meta(ge=1)], ...] = ()
    variable: str = "emg"


class EmgFile(Opened):
    """The samples of a file; sample number n (from 1) is complete at n/rate."""

    kind: ClassVar[Kind] = "emg"
    summary: ClassVar[str] = "a text, .npy or .mat file of EMG samples"
    extra: ClassVar[str] = "lab"
    requires: ClassVar[tuple[str, ...]] = ("scipy",)
    options_type: ClassVar[type[Options]] = EmgFileOptions

    def __init__(self, options: EmgFileOptions) -> None:
        self._options = options
        self._samples: NDArray[np.float64] | None = None
        self._names = tuple(f"ch{c}" for c in options.channels)
        self._next = 0

    @property
    def info(self) -> DeviceInfo:
        """Name, rate, channels and, once open, the number of samples."""
        return DeviceInfo(
            driver="emg-file",
            kind="emg",
            label=self._options.file.name,
            live=False,
            rate_hz=self._options.rate_hz,
            channels=self._names,
            unit="as recorded",
            n_items=None if self._samples is None else len(self._samples),
        )

    def open(self) -> None:
        """Read the file.

        Raises:
            RecordingError: It is missing, cannot be parsed, or lacks a channel.
            MissingExtraError: A ``.mat`` file needs SciPy.
        """
        options = self._options
        self._samples, channels = read_emg_file(options.file, options.channels, variable=options.variable)
        self._names = tuple(f"ch{c}" for c in channels)
        self._next = 0

    def close(self) -> None:
        """Forget the samples."""
        self._samples = None

    @property
    def ended(self) -> bool:
        """Whether all samples were read."""
        return self._samples is not None and self._next >= len(self._samples)

    def read(self, timeout_s: float) -> EmgChunk | None:  # noqa: ARG002  # a file never keeps one waiting
        """Return the next tenth of a second.

        Raises:
            DeviceUnavailableError: The source is not open.
        """
        if self._samples is None:
            raise DeviceUnavailableError(f"emg-file {self._options.file.name!r} is not open", "open it first")
        if self.ended:
            return None
        first = self._next
        self._next = min(first + max(1, round(_CHUNK_S * self._options.rate_hz)), len(self._samples))
        t_ns = round(self._next * 1_000_000_000 / self._options.rate_hz)
        return EmgChunk(t_ns, first, self._samples[first : self._next])
