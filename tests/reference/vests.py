"""A vest whose link keeps what it is told, in place of a radio."""

import time

import numpy as np
from numpy.typing import NDArray

from tega.devices.vest.vest_link import VestLink
from tega.devices.vest.vest_stream import StreamedVest, VestOptions

__all__ = ["HandedOver", "KeptLink", "KeptVest"]


class KeptLink(VestLink):
    """Keeps each frame, and when it came, in seconds of the monotonic clock."""

    def __init__(self) -> None:
        self.sent: list[tuple[float, NDArray[np.uint8]]] = []

    def connect(self) -> None: ...
    def send(self, intensities: NDArray[np.uint8]) -> None:
        self.sent.append((time.monotonic(), intensities.copy()))

    def close(self) -> None: ...


class HandedOver:
    """A vest's account of the frames that have left, filled by hand."""

    def __init__(self) -> None:
        self.handed: list[tuple[int, int, int]] = []

    def handed_over(self) -> list[tuple[int, int, int]]:
        handed, self.handed = self.handed, []
        return handed


class KeptVest(StreamedVest):
    """A streamed vest on such a link."""

    name = "wire-vest"

    def __init__(self, options: VestOptions) -> None:
        super().__init__(options, "wire")
        self.wire = KeptLink()

    def _new_link(self) -> KeptLink:
        return self.wire
