"""Open EDF, EDF+, BDF and BDF+ with edfio, a few records at a time, and WAV files of whole numbers.

Interrupted recordings keep their times; events of WAV files, as SpikeRecorder writes them, stand beside them.
"""

from __future__ import annotations

import contextlib
import io
import re
import warnings
import wave
from collections import Counter
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError
from tega.runtime.files.foreign_file import read_foreign
from tega.runtime.files.tables.encoding import MOST_MIB
from tega.runtime.files.tables.table import (
    MOST_JUDGED,
    FileEvent,
    Reading,
    Table,
    in_one,
    judged_columns,
)
from tega.runtime.lifecycle import require

_BLOCK_BYTES = 4 * 2**20
_ONSET = re.compile(rb"([+-]\d+(?:\.\d*)?)(?:\x15[\d.]*)?\x14")


class _Layout(NamedTuple):
    """Header of a file: its bytes, those of a record, records there are, and where the onsets lie in a record."""

    header: bytes
    record_bytes: int
    n_records: int
    record_s: float
    onset_at: int | None
    sample_bytes: int


def open_edf(path: Path, reading: Reading) -> Table:  # noqa: ARG001  # as all readers
    """Open the signals of one rate: those of EMG by their labels, else those of the rate that most have."""
    edfio: Any = require("edfio", driver="emg-file", extra="formats")
    layout = _layout(path)
    first = next(_parts(edfio, path, layout), None)
    if first is None:
        raise RecordingError(f"{path.name}: holds no record", "copy or export it again")
    signals = first.signals
    names = [signal.label for signal in signals]
    heads = [_data(signal)[:MOST_JUDGED] for signal in signals]
    n_head = min((len(head) for head in heads), default=0)
    head = np.column_stack([head[:n_head] for head in heads]) if heads else np.empty((0, 0))
    columns = judged_columns(names, head, units=list(map(_unit, signals)))
    counts = [signal.samples_per_data_record for signal in signals]
    rates = [count / layout.record_s for count in counts]
    named = [rate for rate, column in zip(rates, columns, strict=True) if column.holds == "channel"]
    usable = [rate for rate, column in zip(rates, columns, strict=True) if column.holds == "unknown"]
    rate_hz = Counter(named or usable or rates or [0.0]).most_common(1)[0][0]
    for column, rate in zip(columns, rates, strict=True):
        if rate != rate_hz and column.holds in {"unknown", "channel"}:
            column.holds, column.why = "sensor", "values"
    is_bdf = layout.sample_bytes == 3
    blocks = partial(_by_records, edfio, path, layout, rates)
    table = Table(path.name, "BDF" if is_bdf else "EDF", columns, blocks)
    table.rate_hz, table.rate_from = rate_hz or None, "its header"
    onsets, table.events = _marks(edfio, path, layout)
    n_row = round(rate_hz * layout.record_s)
    slack_s = 0.5 / max(rate_hz, 1.0)
    if onsets is not None and not np.abs(np.diff(onsets) - layout.record_s).max(initial=0.0) < slack_s:
        table.times_s = (onsets[:, None] + np.arange(n_row) / rate_hz).ravel()
    whole = (path.stat().st_size - len(layout.header)) / layout.record_bytes
    if whole > layout.n_records:
        table.notes.append("the last record is cut short, and left out")
    return table


def _data(signal: Any) -> Any:
    """Return a signal's numbers, without a warning about one that has no range; those come as they are."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return signal.data


def _unit(signal: Any) -> str:
    with contextlib.suppress(ValueError):
        if all(low != high for low, high in (signal.physical_range, signal.digital_range)):
            return str(signal.physical_dimension)
    return "counts"


def _layout(path: Path) -> _Layout:
    with path.open("rb") as file:
        fixed = file.read(256)
        fixed = fixed[:184] + fixed[184:].replace(b",", b".")  # some programs write decimal commas
        try:
            n_header, n_signals, record_s = int(fixed[184:192]), int(fixed[252:256]), float(fixed[244:252])
            header = fixed + file.read(n_header - 256)
            ranges, end = 256 + 104 * n_signals, 256 + 136 * n_signals
            header = header[:ranges] + header[ranges:end].replace(b",", b".") + header[end:]
            labels = [header[256 + 16 * k : 272 + 16 * k].strip() for k in range(n_signals)]
            at = 256 + 216 * n_signals
            counts = [int(header[at + 8 * k : at + 8 * k + 8]) for k in range(n_signals)]
        except ValueError as error:
            raise RecordingError(
                f"{path.name}: a damaged header: {error}", "copy or export it again"
            ) from error
    if not 1e-6 <= record_s <= 1e6:
        text = f"{path.name}: its records last {record_s:g} s, so its signals have no rate"
        raise RecordingError(text, "export it with its signals: it holds annotations alone, or is damaged")
    sample = 3 if fixed[:1] == b"\xff" else 2
    marks = [k for k, label in enumerate(labels) if label in {b"EDF Annotations", b"BDF Annotations"}]
    n_bytes = sum(counts) * sample
    n_records = (path.stat().st_size - len(header)) // n_bytes
    onset_at = sum(counts[: marks[0]]) * sample if marks else None
    return _Layout(header, n_bytes, n_records, record_s, onset_at, sample)


def _parts(edfio: Any, path: Path, layout: _Layout) -> Iterator[Any]:
    """Yield the file a few records at a time, each part as a file of its own."""
    n_part = max(1, _BLOCK_BYTES // layout.record_bytes)
    read = edfio.read_bdf if layout.sample_bytes == 3 else edfio.read_edf
    with path.open("rb") as file:
        file.seek(len(layout.header))
        for at in range(0, layout.n_records, n_part):
            n = min(n_part, layout.n_records - at)
            head = layout.header[:236] + str(n).ljust(8).encode() + layout.header[244:]
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                yield read(io.BytesIO(head + file.read(n * layout.record_bytes)), header_encoding="latin-1")


def _by_records(
    edfio: Any, path: Path, layout: _Layout, rates: list[float], columns: Sequence[int]
) -> Iterator[NDArray[np.float64]]:
    if len({rates[k] for k in columns}) > 1:
        raise RecordingError(
            f"{path.name}: its channels {', '.join(str(k + 1) for k in columns)} have different rates",
            "name channels of one rate",
        )
    for part in _parts(edfio, path, layout):
        yield np.column_stack([_data(part.signals[k]) for k in columns])


def _marks(edfio: Any, path: Path, layout: _Layout) -> tuple[NDArray[np.float64] | None, list[FileEvent]]:
    """Return when each record begins, seconds, and the annotations; ``None`` for a file without them."""
    if layout.onset_at is None:
        return None, []
    onsets = list[float]()
    with path.open("rb") as file:
        for k in range(layout.n_records):
            file.seek(len(layout.header) + k * layout.record_bytes + layout.onset_at)
            found = _ONSET.match(file.read(32))
            onsets.append(float(found[1]) if found else (onsets[-1] + layout.record_s if onsets else 0.0))
    first = onsets[0] if onsets else 0.0
    # Each part counts from where its own first record begins.
    n_part, events = max(1, _BLOCK_BYTES // layout.record_bytes), list[FileEvent]()
    for k, part in enumerate(_parts(edfio, path, layout)):
        offset = onsets[k * n_part]
        events += [FileEvent(t_s=mark.onset + offset - first, text=mark.text) for mark in part.annotations]
    return np.array(onsets), events


def open_wav(path: Path, reading: Reading) -> Table:  # noqa: ARG001  # as all readers
    """Open a recording of whole numbers; its events stand in ``NAME-events.txt`` beside it."""
    try:
        with wave.open(str(path), "rb") as file:
            n_channels, width, rate_hz = file.getnchannels(), file.getsampwidth(), file.getframerate()
            n_frames = min(file.getnframes(), path.stat().st_size // max(1, n_channels * width))
            if n_frames * n_channels * 8 > MOST_MIB * 2**20:
                raise RecordingError(f"{path.name}: more than {MOST_MIB} MiB of numbers", "cut the recording")
            data = file.readframes(n_frames)
    except (wave.Error, EOFError) as error:
        raise RecordingError(f"{path.name}: {error}", "export it as WAV of 16-bit PCM") from error
    whole = len(data) // (n_channels * width) * n_channels * width
    samples = _numbers(data[:whole], width).reshape(-1, n_channels)
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
