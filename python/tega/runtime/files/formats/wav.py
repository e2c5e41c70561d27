"""Open WAV files of whole numbers, as SpikeRecorder writes them, with the events beside them."""

from __future__ import annotations

import wave
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError
from tega.runtime.files.foreign_file import read_foreign
from tega.runtime.files.tables.encoding import MOST_MIB
from tega.runtime.files.tables.table import MOST_JUDGED, FileEvent, Reading, Table, in_one, judged_columns

_FRAMES = 65_536


def open_wav(path: Path, reading: Reading) -> Table:  # noqa: ARG001  # as all readers
    """Open a recording of whole numbers; its events stand in ``NAME-events.txt`` beside it."""
    try:
        with wave.open(str(path), "rb") as file:
            n_channels, width, rate_hz = file.getnchannels(), file.getsampwidth(), file.getframerate()
            n_frames = min(file.getnframes(), path.stat().st_size // max(1, n_channels * width))
            if n_frames * n_channels * 8 > MOST_MIB * 2**20:
                raise RecordingError(f"{path.name}: more than {MOST_MIB} MiB of numbers", "cut the recording")
            samples, at = np.empty((n_frames, n_channels)), 0
            while at < n_frames and (data := file.readframes(min(_FRAMES, n_frames - at))):
                rows = _numbers(data[: len(data) // (n_channels * width) * n_channels * width], width)
                rows = rows.reshape(-1, n_channels)
                samples[at : at + len(rows)] = rows
                at += max(1, len(rows))
    except (wave.Error, EOFError) as error:
        raise RecordingError(f"{path.name}: {error}", "export it as WAV of 16-bit PCM") from error
    samples = samples[:at]
    columns = judged_columns([], samples[:MOST_JUDGED])
    for column in columns:
        column.unit, column.holds, column.why = "counts", "channel", ""
    table = Table(path.name, "WAV", columns, in_one(samples), rate_hz=float(rate_hz), rate_from="its header")
    table.events = _events(path.with_name(f"{path.stem}-events.txt"))
    return table


def _numbers(data: bytes, width: int) -> NDArray[np.float64]:
    if width == 1:
        return np.frombuffer(data, np.uint8).astype(np.float64) - 128.0
    if width == 3:
        wide = np.zeros((len(data) // 3, 4), np.uint8)
        wide[:, 1:] = np.frombuffer(data, np.uint8).reshape(-1, 3)
        return (wide.view("<i4").ravel() >> 8).astype(np.float64)
    return np.frombuffer(data, f"<i{width}").astype(np.float64)


def _events(path: Path) -> list[FileEvent]:
    """Return the events beside a recording: lines of a number, a comma and seconds; ``#`` begins a comment."""
    events = []
    if path.is_file():
        for line in read_foreign(path, most_mib=16).decode("utf-8", "replace").splitlines():
            text, comma, seconds = line.partition(",")
            try:
                if comma and not line.startswith("#"):
                    events.append(FileEvent(t_s=float(seconds), text=text.strip()))
            except ValueError:
                continue
    return events
