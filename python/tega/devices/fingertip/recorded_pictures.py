"""Give the pictures of a recording in their order; a driver adds how they are found and decoded."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from tega.devices.base import DeviceInfo, Kind, TactileFrame
from tega.errors import DeviceUnavailableError, RecordingError
from tega.runtime.lifecycle import Opened

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class RecordedPictures(Opened):
    """Pictures of one size, numbered from 0, of a file or folder ``label``.

    ``rate_hz`` is pictures per second as far as known; a driver updates it when it is opened.
    """

    kind: ClassVar[Kind] = "tactile"
    name: ClassVar[str]

    def __init__(self, label: str, rate_hz: float | None = None) -> None:
        self._label, self._rate_hz = label, rate_hz
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
        """Begin with the first of so many pictures."""
        self._n_pictures, self._seq, self._shape = n_pictures, 0, ()

    @property
    def ended(self) -> bool:
        """Whether all pictures were read."""
        return self._n_pictures is not None and self._seq >= self._n_pictures

    def _next(self) -> int:
        """Return the number of the next picture, and go on behind it."""
        self._seq += 1
        return self._seq - 1

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
