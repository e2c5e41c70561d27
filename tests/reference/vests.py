"""A vest whose link keeps what it is told, in place of a radio."""

import time

import numpy as np
from numpy.typing import NDArray

from tega.devices.vest.vest_stream import StreamedVest, VestOptions

__all__ = ["KeptLink", "KeptVest"]


class KeptLink:
    """Keeps each frame, and when it came, in seconds of the monotonic clock."""

    present = True
    notes: tuple[str, ...] = ()
    condition = ""
    battery_percent: int | None = None

    def __init__(self) -> None:
        self.sent: list[tuple[float, NDArray[np.uint8]]] = []

    def connect(self) -> None: ...
    def ready(self, timeout_s: float) -> bool:  # noqa: ARG002
        return True

    def send(self, intensities: NDArray[np.uint8]) -> None:
        self.sent.append((time.monotonic(), intensities.copy()))

    def poll(self) -> None: ...
    def close(self) -> None: ...
    def abort(self) -> None: ...


class KeptVest(StreamedVest):
    """A streamed vest on such a link."""

    name = "wire-vest"

    def __init__(self, options: VestOptions) -> None:
        super().__init__(options)
        self.wire = KeptLink()

    def _new_link(self) -> KeptLink:
        return self.wire

    @property
    def _label(self) -> str:
        return "wire"
