"""A vest driver and the emulator at its other end; a vest whose link keeps what it is told, in place of a radio."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from tega.devices import driver_class
from tega.devices.vest.vest_link import VestLink
from tega.devices.vest.vest_stream import StreamedVest, VestOptions
from tega.haptics import MotorLevels, vest_frame
from tega.wire import vest_levels
from tega_emulators.hid_port import HidPort
from tega_emulators.process import Emulator
from tega_emulators.vest_bench import seen_by, vest_bench

TOUCH = vest_frame([80, 60, 40, 20], [13, 0, 100, 53], layout="x40")
OTHER = vest_frame([7, 20, 33, 47], [60, 67, 73, 87], layout="x40")
SILENT = [0] * 40


class Bench(NamedTuple):
    """A vest driver and the emulator at its other end."""

    vest: StreamedVest
    peer: Emulator
    port: HidPort | None = None

    def shows(self, frame: MotorLevels) -> bool:
        """Tell whether the motors do what a frame says, to the level."""
        return bool(np.array_equal(vest_levels(seen_by(self.peer).motors), vest_levels(frame.x40())))

    def feed(self, condition: Callable[[], bool], frame: MotorLevels = TOUCH) -> None:
        """Write a frame again and again, as the loop does, until something holds."""
        self.wait(lambda: bool(self.vest.write(0, frame)) and condition())

    def wait(self, condition: Callable[[], bool]) -> None:
        for _ in range(3000):
            if condition():
                return
            time.sleep(0.02)
        pytest.fail(f"never came true; {self.vest.counters}; {self.vest.info.notes}")


def make(name: str, **options: Any) -> StreamedVest:
    driver: Any = driver_class(name, "vest")
    vest: StreamedVest = driver(driver.options_type(**options))
    return vest


@contextmanager
def bench(name: str, **options: Any) -> Iterator[Bench]:
    if name == "bhaptics-ble" and shutil.which("dbus-daemon") is None:
        pytest.skip("dbus-daemon is not installed")
    with vest_bench(name, **options) as made:
        yield Bench(made.vest, made.peer, made.port)


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
