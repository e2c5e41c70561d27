"""Read a file of samples: open it by its format, choose the columns, compare time and rate."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError, TegaError
from tega.runtime.files.foreign_file import check_file
from tega.runtime.files.formats import format_of
from tega.runtime.files.tables.decide import Decision, decide
from tega.runtime.files.tables.encoding import MOST_MIB
from tega.runtime.files.tables.judging import FEWEST, SECONDS
from tega.runtime.files.tables.table import Reading, Table
from tega.runtime.files.tables.timing import (
    RATE_TOLERANCE,
    Timing,
    compare,
    losses_in_words,
    lost_by_counter,
    slope_of,
    to_seconds,
)

# Channels of one amplifier may end so much apart: a logger that was stopped in the middle of a row.
_MOST_UNEVEN = 0.01
_FEWEST_UNEVEN = 8
_WHOLE = 0.9


class Signals(NamedTuple):
    """Samples of a file.

    Attributes:
        samples: float64 (n, channels), in the file's unit, NaN where a cell has no number.
        channels: Their columns in the file, from 1.
        rate_hz: Samples per second; ``None`` if neither the file nor the user states them.
        starts: Rows at which a stretch without a loss begins, and their numbers with lost samples counted in.
        timing: Course of the file's times; ``None`` if it has none.
    """

    samples: NDArray[np.float64]
    channels: tuple[int, ...]
    rate_hz: float | None
    starts: list[tuple[int, int]]
    timing: Timing | None
    decision: Decision

    @property
    def notes(self) -> tuple[str, ...]:
        """Facts that a reader of the results must know: choices made, and faults of the times."""
        decision = self.decision
        return (*([decision.words] if decision.words else []), *decision.faults, *decision.notes)


def read_signals(path: Path, reading: Reading | None = None) -> Signals:
    """Read the samples of a file.

    Raises ``RecordingError`` where it is missing, cannot be parsed, holds no sample, lacks a channel, can be
    read in several ways, or its times contradict the rate.
    """
    reading = reading or Reading()
    table = _opened(path, reading)
    decision = decide(table, reading)
    beside = [c for c in dict.fromkeys((decision.time, decision.counter)) if c]
    samples, others = _loaded(table, decision.channels, beside)
    n = _length(table.file, samples, decision)
    samples, others = samples[:n], others[:n]
    counted = lost_by_counter(others[:, beside.index(decision.counter)]) if decision.counter else []
    times_s, subject = _times(table, decision, reading, others, n)
    _stated(table, decision, reading, subject if times_s is not None else "")
    timing = None
    if times_s is not None:
        rate_hz = decision.rate_hz
        timing = compare(times_s, samples, rate_hz=rate_hz, counted=counted, subject=subject, file=table.file)
        decision.rate_hz = timing.rate_hz
        decision.faults += timing.faults
        counted = timing.lost
        samples = np.delete(samples, timing.repeated, axis=0) if len(timing.repeated) else samples
    elif counted:
        decision.faults.append(losses_in_words(counted, decision.rate_hz))
    if n_missing := int(np.isnan(samples).sum()):
        decision.notes.append(f"{n_missing} cells have no number; they count as missing samples")
    decision.n_samples = len(samples)
    starts, n_lost = [(0, 0)], 0
    for row, lost in counted:
        n_lost += lost
        starts.append((row, row + n_lost))
    samples = np.ascontiguousarray(samples, np.float64)
    return Signals(samples, tuple(decision.channels), decision.rate_hz, starts, timing, decision)


def _opened(path: Path, reading: Reading) -> Table:
    if not path.exists() or path.is_dir():
        raise RecordingError(f"{path.name}: no such EMG file", f"looked for {path}")
    check_file(path, most_mib=MOST_MIB)
    try:
        return format_of(path).open(path, reading)
    except Exception as error:
        raise _text(path.name, error) from error


def _loaded(
    table: Table, channels: Sequence[int], beside: Sequence[int]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    try:
        samples, others = table.load([c - 1 for c in channels], [c - 1 for c in beside])
    except Exception as error:
        raise _text(table.file, error) from error
    if not len(samples):
        raise RecordingError(f"{table.file}: holds no sample", "one row of numbers per sample is expected")
    return samples, others


def _text(name: str, error: Exception) -> Exception:
    """Return an error as it is, or as one of a damaged file: a library raises whatever the bytes lead it to."""
    if isinstance(error, TegaError) or (isinstance(error, OSError) and error.errno is not None):
        return error
    return RecordingError(
        f"{name}: damaged, or of another format than its name: {type(error).__name__}: {str(error)[:200]}",
        "copy or export it again",
    )


def _length(file: str, samples: NDArray[np.float64], decision: Decision) -> int:
    """Return the rows that all channels have; columns of sensors at other rates end early."""
    n = len(samples)
    there = np.logical_not(np.isnan(samples))
    empty = [str(c) for k, c in enumerate(decision.channels) if not there[:, k].any()]
    if empty:
        rest = ",".join(str(c) for c in decision.channels if str(c) not in empty)
        if not rest:
            raise RecordingError(
                f"{file}: holds no sample: no cell of its channels is a number", "export it again"
            )
        raise RecordingError(
            f"{file}: column {', '.join(empty)} holds no number", f"name the channels without it: {rest}"
        )
    ends = n - np.argmax(there[::-1], axis=0)
    shortest, longest = int(ends.min()), int(ends.max())
    if longest - shortest > max(_FEWEST_UNEVEN, _MOST_UNEVEN * n):
        early = {c: int(end) for c, end in zip(decision.channels, ends, strict=True) if end < longest}
        first, rest = next(iter(early)), ",".join(str(c) for c in decision.channels if c not in early)
        raise RecordingError(
            f"{file}: column {first} ends at sample {early[first]} of {longest}: it has another rate, or was cut",
            f"name the channels without it: {rest}",
        )
    if shortest < longest:
        decision.notes.append(
            f"channels end up to {longest - shortest} samples apart; read to where the first one ends"
        )
        return shortest
    return longest if n - longest > 1 else n


def _times(
    table: Table, decision: Decision, reading: Reading, others: NDArray[np.float64], n: int
) -> tuple[NDArray[np.float64] | None, str]:
    """Return the file's times in seconds and their name; ``None`` where it has none that can be used."""
    if table.times_s is not None and reading.time != "none":
        return table.times_s[:n], "its clock"
    if not decision.time or n < FEWEST:
        return None, ""
    column = table.columns[decision.time - 1]
    unit_s = SECONDS.get(column.unix or column.unit.lower())
    whole = float(np.isfinite(others[:, 0]).mean()) > _WHOLE  # else it is another sensor's, at another rate
    times_s = to_seconds(others[:, 0], unit_s, reading.rate_hz or table.rate_hz) if whole else None
    if times_s is None or (slope_of(times_s) or 0.0) <= 0:
        if decision.time == reading.time:
            raise RecordingError(
                f"{table.file}: {column.called} is no time", "set time to another column, or to none"
            )
        if column.why == "name":
            decision.notes.append(
                f"{column.called} is not used as time: it does not rise by steps of any unit"
            )
        decision.time = 0
        return None, ""
    return times_s, column.called


def _stated(table: Table, decision: Decision, reading: Reading, subject: str) -> None:
    """Note the stated rate; refuse one that the file contradicts."""
    if subject and table.rate_hz and reading.rate_hz:
        pass  # the times decide
    elif reading.rate_hz and table.rate_hz and abs(table.rate_hz / reading.rate_hz - 1) > RATE_TOLERANCE:
        raise RecordingError(
            f"{table.file}: {table.rate_hz:g} samples/s by {table.rate_from}, {reading.rate_hz:g} were given",
            f"leave the rate out or set it to {table.rate_hz:g}",
        )
    decision.rate_hz = reading.rate_hz or table.rate_hz
    decision.rate_from = "given" if reading.rate_hz else table.rate_from if table.rate_hz else subject
