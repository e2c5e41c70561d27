"""Emulated EMG boards and the drivers that read them."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from tega.devices.base import EmgChunk
from tega.devices.emg.chords import Chords, ChordsOptions
from tega.devices.emg.cyton import Cyton, CytonOptions
from tega.devices.emg.live_emg import LiveEmg
from tega.devices.emg.serial_emg import SerialEmg, SerialEmgOptions
from tega.devices.emg.spiker import Spiker, SpikerOptions
from tega.errors import DeviceUnavailableError
from tega_emulators.process import Emulator
from tega_lsl.emg import LslEmg, LslEmgOptions

# Nothing here waits that long unless it fails.
PATIENCE_S = 60.0
QUICK = {"measure_s": 0.25, "silence_s": 20.0, "start_s": 10.0}
CYTON_STEP_UV = 100 * 4.5e6 / 24 / (2**23 - 1)


class Case(NamedTuple):
    emulator: str
    arguments: tuple[str, ...]
    make: Callable[..., LiveEmg]
    steps: Callable[[NDArray[np.float64]], NDArray[np.float64]]


CASES = {
    "serial-emg": Case(
        "ascii_board",
        ("--rate", "500"),
        lambda **o: SerialEmg(SerialEmgOptions(**({"rate_hz": 500.0, "bits": 10} | o))),
        lambda samples: samples - 512,
    ),
    "cyton": Case("cyton", (), lambda **o: Cyton(CytonOptions(**o)), lambda samples: samples / CYTON_STEP_UV),
    "chords": Case("chords", (), lambda **o: Chords(ChordsOptions(**o)), lambda samples: samples - 2048),
    "spiker": Case("spiker", (), lambda **o: Spiker(SpikerOptions(**o)), lambda samples: samples - 512),
    "lsl-emg": Case(
        "lsl",
        (),
        lambda port, **o: LslEmg(LslEmgOptions(by="source_id", value=port, **o)),
        lambda samples: samples,
    ),
}


def emulator(name: str, *arguments: str) -> Emulator:
    return Emulator(CASES[name].emulator, *CASES[name].arguments, *arguments)


def opened(name: str, device: Emulator, **options: Any) -> LiveEmg:
    return CASES[name].make(**({"port": device.port} | QUICK | options))


def refused(text: str, name: str, *arguments: str, **options: Any) -> DeviceUnavailableError:
    """Open a board that an error has to name."""
    with emulator(name, *arguments) as device, pytest.raises(DeviceUnavailableError, match=text) as error:
        opened(name, device, **options).open()
    return error.value


def chunks_of(source: LiveEmg, n_samples: int) -> list[EmgChunk]:
    chunks, n, deadline = [], 0, time.monotonic() + PATIENCE_S
    while n < n_samples:
        assert time.monotonic() < deadline, f"{n} samples after {PATIENCE_S} s"
        chunk = source.read(0.1)
        if chunk is not None:
            chunks.append(chunk)
            n += len(chunk.samples)
    return chunks


def error_of(source: LiveEmg) -> DeviceUnavailableError:
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        try:
            source.read(0.1)
        except DeviceUnavailableError as error:
            return error
    raise AssertionError(f"still alive after {PATIENCE_S} s")


def phases(name: str, chunks: list[EmgChunk]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return by how much each row of the ramp is off its index, modulo 1000, and which rows are whole."""
    index = np.concatenate([c.first_index + np.arange(len(c.samples)) for c in chunks])
    steps = CASES[name].steps(np.concatenate([c.samples for c in chunks]))
    whole = np.rint(steps).astype(np.int64)
    if name == "serial-emg":
        # Ten bits end at 1023: what would be above is cut off.
        assert whole.max() <= 511
    exact = (np.abs(steps - whole) < 1e-6).all(axis=1)
    rows = (whole[:, [0]] + 500 + 100 * np.arange(whole.shape[1])) % 1000 - 500
    exact &= (rows == whole).all(axis=1)
    return (whole[:, 0] + 500 - index) % 1000, exact
