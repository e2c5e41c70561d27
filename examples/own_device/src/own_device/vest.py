"""A vest of your own. What is marked with YOUR DEVICE only remembers the last frame: put your device there."""

from __future__ import annotations

from typing import Annotated, ClassVar

import msgspec
import numpy as np

from tega.devices import DeviceInfo, Opened, Options
from tega.errors import DeviceUnavailableError
from tega.haptics import MotorLevels


class OwnVestOptions(Options, frozen=True):
    """The keys of the driver's ``options`` table.

    Attributes:
        limit: No motor is driven harder, percent.
    """

    limit: Annotated[int, msgspec.Meta(ge=0, le=100)] = 60


class OwnVest(Opened):
    """A vest with 40 motors in the wearer's order, front then back, left to right, top to bottom."""

    kind: ClassVar = "vest"
    summary: ClassVar[str] = "template of a vest"
    extra: ClassVar[str] = ""
    requires: ClassVar[tuple[str, ...]] = ()
    options_type: ClassVar[type[Options]] = OwnVestOptions

    def __init__(self, options: OwnVestOptions) -> None:
        self._options = options
        self._motors: np.ndarray | None = None

    @property
    def info(self) -> DeviceInfo:
        """What the device says of itself; readable while it is closed."""
        return DeviceInfo(driver="own-vest", kind="vest", label="template", live=True, unit="percent")

    def open(self) -> None:
        """Connect, and begin silent."""
        self._motors = np.zeros(40, np.uint8)  # YOUR DEVICE: connect, send zeros

    def close(self) -> None:
        """Silence every motor, then disconnect. A person wears this: no way out may skip it."""
        self._motors = None  # YOUR DEVICE: send zeros, disconnect

    def write(self, t_ns: int, frame: MotorLevels) -> MotorLevels:  # noqa: ARG002  # the time is for recorders
        """Send a frame, 0 to 100 a motor, and return the one really sent; it must not wait for the device.

        A frame comes 30 times a second, a silent one at least every 0.1 s. Let the device fall silent by itself after
        0.2 s without one.
        """
        if self._motors is None:
            raise DeviceUnavailableError("own-vest is not open", "open it first")
        sent = MotorLevels(frame.layout, np.minimum(frame.intensities, self._options.limit).astype(np.uint8))
        self._motors[:] = sent.x40()  # YOUR DEVICE: send them
        return sent
