"""Read and write a sound recording (WAV), and beside it the log of commands during it (JSON)."""

from __future__ import annotations

import io
import wave
from datetime import datetime
from pathlib import Path
from typing import Final, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.errors import MissingExtraError, RecordingError
from tega.runtime.files.foreign_file import parse_json, read_foreign
from tega.runtime.files.whole_file import write_whole
from tega_bench.vest_latency.clock import ClockMap

# Twenty minutes of two channels at 48 kHz, floats of 32 bits.
_MOST_MIB: Final = 512
# Of full scale; files of floats may go a little over 1.
_LOUDEST: Final = 1e6


class OnsetLog(msgspec.Struct, frozen=True, kw_only=True, tag_field="format", tag="tega-onset-log"):
    """The bursts of one motor; times in seconds from any moment, all from the same.

    Attributes:
        made: When, UTC.
        layout: Which motors it has.
        percent: How hard.
        on_s: How long each burst lasted.
        bursts_s: When each burst's first frame was handed to the transport; ``unsent`` were not.
        clicks_s: When there was a click to go by.
        clicks: What made it; ``""`` for none.
        clock: In logs of before version 0.3 that have no clicks: how the recording lies in time.
        notes: Of the vest's driver.
    """

    version: Literal[1] = 1
    made: datetime
    driver: str
    device: str
    layout: str
    motor: int
    percent: int
    on_s: float
    bursts_s: tuple[float, ...]
    unsent: int = 0
    clicks_s: tuple[float, ...] = ()
    clicks: Literal["", "keys", "speaker"] = ""
    clock: ClockMap | None = None
    notes: tuple[str, ...] = ()


def write_log(log: OnsetLog, path: Path) -> None:
    """Write a log, whole or not at all."""
    write_whole(path, msgspec.json.format(msgspec.json.encode(log)) + b"\n", sync=True)


def read_log(path: Path) -> OnsetLog:
    """Read a log; ``RecordingError`` if it is missing, or is no such log."""
    try:
        return parse_json(read_foreign(path, most_mib=64), OnsetLog)
    except OSError as error:
        raise RecordingError(f"{path.name}: cannot be read: {error.strerror or error}") from error
    except msgspec.DecodeError as error:
        raise RecordingError(
            f"{path.name}: is no log of a motor's bursts: {error}",
            "give the file that 'tega-teleop vest onset --log' wrote",
        ) from error


def read_wav(path: Path) -> tuple[NDArray[np.float64], float]:
    """Read a recording, float64 (n,), -1 to 1, and its samples per second; of several channels, the loudest.

    ``RecordingError`` if it is missing, or no WAV file.
    """
    try:
        from scipy.io import wavfile
    except ImportError as error:
        raise MissingExtraError(
            "the package 'scipy' is not installed", "pip install 'tega[onset]'"
        ) from error
    try:
        content = read_foreign(path, most_mib=_MOST_MIB)
    except OSError as error:
        raise RecordingError(f"{path.name}: cannot be read: {error.strerror or error}") from error
    try:
        rate_hz, data = wavfile.read(io.BytesIO(content))
    except Exception as error:  # whatever a damaged header leads to
        raise RecordingError(
            f"{path.name}: is no WAV file: {error}", f"convert it: ffmpeg -i {path.name} recording.wav"
        ) from error
    if data.dtype == np.uint8:
        samples = (data.astype(np.float64) - 128) / 128
    elif np.issubdtype(data.dtype, np.integer):
        samples = data / float(np.iinfo(data.dtype).max)
    else:
        samples = data.astype(np.float64)
    if not len(samples) or not rate_hz or not (np.abs(samples) < _LOUDEST).all():
        raise RecordingError(f"{path.name}: holds nothing, or no numbers, or has no rate", "record again")
    if samples.ndim > 1:
        samples = samples[:, int(samples.std(axis=0).argmax())]
    return samples, float(rate_hz)


def write_wav(path: Path, samples: NDArray[np.float64], rate_hz: float) -> None:
    """Write a recording, 16 bits, mono; samples are float64 (n,), -1 to 1, and clipped there."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(round(rate_hz))
        file.writeframes((np.clip(samples, -1, 1) * 32767).round().astype("<i2").tobytes())
