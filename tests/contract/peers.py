"""What stands behind a driver that needs somebody to talk to: an emulator for as long as the check runs.

A driver with hardware adds its name here, with a function that starts its peer and gives the options to reach it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

from tega.testing.emulators.process import Emulator

__all__ = ["PEERS", "Peer"]

Peer = Callable[[Path], AbstractContextManager[dict[str, Any]]]


@contextmanager
def _serial_emg(_folder: Path) -> Iterator[dict[str, Any]]:
    with Emulator("ascii_board", "--rate", "500") as board:
        yield {"port": board.port, "rate_hz": 500.0, "bits": 10, "measure_s": 0.3}


@contextmanager
def _cyton(_folder: Path) -> Iterator[dict[str, Any]]:
    with Emulator("cyton") as board:
        yield {"port": board.port, "measure_s": 0.3}


@contextmanager
def _chords(_folder: Path) -> Iterator[dict[str, Any]]:
    with Emulator("chords") as board:
        yield {"port": board.port, "measure_s": 0.3}


@contextmanager
def _lsl_emg(_folder: Path) -> Iterator[dict[str, Any]]:
    with Emulator("lsl") as outlet:
        yield {"by": "source_id", "value": outlet.port, "measure_s": 0.3}


PEERS: dict[str, Peer] = {
    "chords": _chords,
    "cyton": _cyton,
    "lsl-emg": _lsl_emg,
    "serial-emg": _serial_emg,
}
