"""Score how well a person follows a curve of levels (no force is measured), and keep the EMG to fit a decoder to."""

from __future__ import annotations

import io
import random
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.config.calibration.records import PracticeRecord, read_record
from tega.devices.base import EmgChunk
from tega.errors import CalibrationError, InvalidValueError
from tega.runtime.files.foreign_file import load_npy, read_foreign
from tega.runtime.files.whole_file import write_whole
from tega.stages.learned.compare import Log

_HOLD_S = 3.0
_RAMP_S_PER_LEVEL = 0.75
_LONGEST_DELAY_S = 1.0


class Curve:
    """Ramps and holds between the five levels, in an order of chance; begins and ends at rest.

    No level follows itself, and every five holds visit every level. ``duration_s`` must be at least 10.
    """

    def __init__(self, duration_s: float, *, seed: int) -> None:
        if duration_s < 10:
            raise InvalidValueError(f"duration {duration_s:g} s is too short: 10 s at least")
        chance = random.Random(seed)
        self.duration_s = duration_s
        times, levels = [0.0, _HOLD_S], [1.0, 1.0]
        order: list[int] = []
        while times[-1] < duration_s:
            if not order:
                order = chance.sample(range(1, 6), 5)
                if order[0] == levels[-1]:
                    order.append(order.pop(0))
            level = order.pop(0)
            ramp_s = _RAMP_S_PER_LEVEL * abs(level - levels[-1])
            times += [times[-1] + ramp_s, times[-1] + ramp_s + _HOLD_S]
            levels += [float(level)] * 2
        self._times, self._levels = np.array(times), np.array(levels)

    def at(self, t_s: float) -> float:
        """Return the level asked for, 1 to 5."""
        return float(np.interp(t_s, self._times, self._levels))


class Score(NamedTuple):
    """Score of a followed curve.

    ``in_target`` is the share of the time on the level asked for (the nearest one, during a ramp).
    ``delay_s`` is the shift at which the level fits the curve best, 0 to 1 s; ``None`` if it never changed.
    """

    in_target: float
    rms_error_levels: float
    delay_s: float | None


def score(t_s: Sequence[float], levels: Sequence[int], curve: Curve) -> Score:
    """Score levels against a curve; there must be a level, and a time for each."""
    if not levels or len(levels) != len(t_s):
        raise InvalidValueError(f"{len(levels)} levels at {len(t_s)} times cannot be scored")
    own = np.array(levels, np.float64)

    def wanted(shift_s: float) -> NDArray[np.float64]:
        return np.array([curve.at(t - shift_s) for t in t_s])

    error = own - wanted(0.0)
    shifts = np.arange(0.0, _LONGEST_DELAY_S + 1e-9, 0.05)
    errors = [float(((own - wanted(float(s))) ** 2).mean()) for s in shifts]
    return Score(
        in_target=float((np.abs(error) <= 0.5).mean()),
        rms_error_levels=float(np.sqrt((error**2).mean())),
        delay_s=float(shifts[int(np.argmin(errors))]) if np.ptp(own) else None,
    )


_MOST_MIB = 1024
_TOP_STEPS = 4


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


def read_tracked(record: Path) -> tuple[Log, PracticeRecord]:
    """Read a practice record and the EMG beside it, in the source's unit, which earlier versions did not keep."""
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
    samples, target = np.ascontiguousarray(data[:, :-1]), np.ascontiguousarray(data[:, -1])
    return Log(record.name, samples, target, reported.rate_hz, reported.kind), reported
