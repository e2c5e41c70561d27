"""An EMG amplifier of your own. What is marked with YOUR DEVICE makes a signal up: put your device there."""

from __future__ import annotations

import time
from typing import Annotated, ClassVar

import msgspec
import numpy as np

from tega.devices import DeviceInfo, EmgChunk, Opened, Options
from tega.errors import DeviceUnavailableError


class OwnEmgOptions(Options, frozen=True):
    """The keys of the driver's ``options`` table; a wrong type or an unknown key is refused for you.

    Attributes:
        port: Where the amplifier is.
        rate_hz: Samples a second; at least 125, or the filter at 50 Hz does not work.
        n_channels: How many it has.
    """

    port: str = "nowhere"
    rate_hz: Annotated[float, msgspec.Meta(ge=125, le=10_000)] = 500.0
    n_channels: Annotated[int, msgspec.Meta(ge=1, le=16)] = 3


class OwnEmg(Opened):  # Opened gives the `with` block: it calls open and close
    """A live source of samples. The constructor keeps the options and does nothing else."""

    kind: ClassVar = "emg"
    summary: ClassVar[str] = "template of an EMG amplifier"
    extra: ClassVar[str] = ""  # the optional dependency of your package that brings what `requires` names
    requires: ClassVar[tuple[str, ...]] = ()  # modules that are imported in open(), not above
    options_type: ClassVar[type[Options]] = OwnEmgOptions

    def __init__(self, options: OwnEmgOptions) -> None:
        self._options = options
        self._opened_ns: int | None = None
        self._n_delivered = 0

    @property
    def info(self) -> DeviceInfo:
        """What the device says of itself; readable while it is closed. The label is a name, never a path."""
        o = self._options
        return DeviceInfo(
            driver="own-emg",
            kind="emg",
            label=o.port.rsplit("/", 1)[-1],
            live=True,
            rate_hz=o.rate_hz,
            channels=tuple(f"ch{c + 1}" for c in range(o.n_channels)),
            unit="µV",
            notes=(),  # sentences that a reader of the results must know: losses, a low battery
        )

    def open(self) -> None:
        """Connect. What can go wrong here raises DeviceUnavailableError with the next step as its second argument."""
        self.close()
        if self._options.port == "broken":  # YOUR DEVICE: open the port
            raise DeviceUnavailableError("own-emg: nothing answers on broken", "is it switched on?")
        self._opened_ns, self._n_delivered = time.monotonic_ns(), 0

    def close(self) -> None:
        """Disconnect; called twice, and when nothing was opened."""
        self._opened_ns = None  # YOUR DEVICE: close the port

    @property
    def ended(self) -> bool:
        """A live source never ends: it raises when it is lost."""
        return False

    def read(self, timeout_s: float) -> EmgChunk | None:
        """Return what has come, as soon as something has; None when nothing came within timeout_s."""
        if self._opened_ns is None:
            raise DeviceUnavailableError("own-emg is not open", "open it first")
        deadline_s = time.monotonic() + timeout_s
        while True:
            samples = self._received(self._opened_ns)
            if len(samples):
                first = self._n_delivered
                self._n_delivered += len(samples)
                # The number of the first sample counts lost ones too: that is how the filters learn of a gap.
                return EmgChunk(time.monotonic_ns(), first, samples)
            if time.monotonic() >= deadline_s:
                return None
            time.sleep(0.002)

    def _received(self, opened_ns: int) -> np.ndarray:
        """YOUR DEVICE: return what has arrived, float64 (samples, channels), without waiting."""
        o = self._options
        due = int((time.monotonic_ns() - opened_ns) * 1e-9 * o.rate_hz)
        t_s = np.arange(self._n_delivered, max(due, self._n_delivered)) / o.rate_hz
        return np.stack([50.0 * np.sin(2 * np.pi * (20 + c) * t_s) for c in range(o.n_channels)], axis=1)
