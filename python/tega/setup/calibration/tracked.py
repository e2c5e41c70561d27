"""Keep the EMG of a tracked curve beside the closure asked for, to fit a decoder to."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.config.calibration.records import PracticeRecord, read_record
from tega.devices.base import EmgChunk
from tega.errors import CalibrationError
from tega.runtime.files.foreign_file import load_npy, read_foreign
from tega.runtime.files.whole_file import write_whole
from tega.setup.calibration.practice import Curve

_MOST_MIB = 1024
_TOP_STEPS = 4


class Tracked(NamedTuple):
    """EMG of a tracked curve, ``(n, channels)``, in the source's unit.

    ``target`` is the closure asked for at each sample, 0 to 1, ``(n,)``.
    """

    samples: NDArray[np.float64]
    target: NDArray[np.float64]
    rate_hz: float
    kind: Literal["raw", "rectified", "envelope"]
    channels: tuple[str, ...]
    person: str


def tracked_samples(
    chunks: Sequence[EmgChunk], curve: Curve, *, rate_hz: float, start_ns: int
) -> NDArray[np.float64]:
    """Put the closure that was asked for, 0 to 1, last in each sample's row: ``(n, channels + 1)``.

    Times come from the samples' numbers, as many a second as the source has, from the first chunk's time on:
    a chunk's own time is that of its arrival. What came before the curve began is left out; lost samples
    leave a gap.
    """
    if not chunks:
        return np.empty((0, 1))
    first = chunks[0]
    zero_s = (first.t_ns - start_ns) * 1e-9 - (first.first_index + len(first.samples)) / rate_hz
    parts = []
    for chunk in chunks:
        number = chunk.first_index + 1 + np.arange(len(chunk.samples))
        t_s = zero_s + number / rate_hz
        closure = np.array([(curve.at(max(0.0, t)) - 1) / _TOP_STEPS for t in t_s])
        parts.append(np.column_stack([chunk.samples, closure])[t_s >= 0])
    return np.concatenate(parts)


def keep_tracked(data: NDArray[np.float64], record: Path) -> Path:
    """Write the samples and the closure beside a practice record, as ``.npy``."""
    file = io.BytesIO()
    np.save(file, data, allow_pickle=False)
    path = record.with_suffix(".npy")
    write_whole(path, file.getvalue(), sync=True)
    return path


def read_tracked(record: Path) -> Tracked:
    """Read the EMG of a practice record, which earlier versions did not keep."""
    if not record.is_file():
        raise CalibrationError(f"{record.name}: no such practice record", f"looked for {record}")
    reported = read_record(record, PracticeRecord)
    path = record.with_suffix(".npy")
    if reported.kind is None or reported.rate_hz is None or not path.exists():
        raise CalibrationError(
            f"{record.name}: keeps no EMG", "track again: tega-teleop practice SETTINGS.toml --person ID"
        )
    try:
        data = load_npy(read_foreign(path, most_mib=_MOST_MIB, error=CalibrationError), path.name)
    except ValueError as error:
        raise CalibrationError(f"{path.name}: damaged: {error}", "track again") from error
    if data.dtype != np.float64 or data.ndim != 2 or data.shape[1] != len(reported.channels) + 1:
        raise CalibrationError(
            f"{path.name}: {data.dtype} {data.shape}, expected float64 (n, {len(reported.channels) + 1})",
            "track again",
        )
    return Tracked(
        np.ascontiguousarray(data[:, :-1]),
        np.ascontiguousarray(data[:, -1]),
        reported.rate_hz,
        reported.kind,
        reported.channels,
        reported.person,
    )
