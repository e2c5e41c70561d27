"""Open Parquet tables with pyarrow, a batch of rows at a time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError
from tega.runtime.files.tables.encoding import MOST_MIB
from tega.runtime.files.tables.table import MOST_JUDGED, Blocks, Reading, Table, judged_columns
from tega.runtime.lifecycle import require

_ROWS = 65_536


def open_parquet(path: Path, reading: Reading) -> Table:  # noqa: ARG001  # as all readers
    """Open a table of named columns, one of numbers at least; columns that hold no numbers are text."""
    parquet: Any = require("pyarrow.parquet", driver="emg-file", extra="formats")
    types: Any = require("pyarrow.types", driver="emg-file", extra="formats")
    with parquet.ParquetFile(path) as file:
        schema = file.schema_arrow
        if file.metadata.num_rows * max(1, len(schema.names)) * 8 > MOST_MIB * 2**20:
            raise RecordingError(f"{path.name}: more than {MOST_MIB} MiB of numbers", "cut the recording")
        times = [types.is_timestamp(kind) or types.is_duration(kind) for kind in schema.types]
        text = [
            not (types.is_integer(kind) or types.is_floating(kind) or time)
            for kind, time in zip(schema.types, times, strict=True)
        ]
        head = np.full((0, len(text)), np.nan)
        for batch in file.iter_batches(batch_size=MOST_JUDGED):
            head = np.column_stack(
                [
                    np.full(len(batch), np.nan) if is_text else _numbers(batch.column(k))
                    for k, is_text in enumerate(text)
                ]
            )
            break
        columns = judged_columns(schema.names, head, text=text)
    for column, is_time in zip(columns, times, strict=True):
        if is_time:
            column.holds, column.unit, column.unix, column.why = "time", "s", "", "values"
    return Table(path.name, "Parquet", columns, _by_batches(parquet, path))


def _by_batches(parquet: Any, path: Path) -> Blocks:
    def blocks(columns: Sequence[int]) -> Iterator[NDArray[np.float64]]:
        with parquet.ParquetFile(path) as file:
            wanted = [file.schema_arrow.names[k] for k in columns]
            for batch in file.iter_batches(batch_size=_ROWS, columns=wanted):
                place = {name: k for k, name in enumerate(batch.schema.names)}
                yield np.column_stack([_numbers(batch.column(place[name])) for name in wanted])

    return blocks


def _numbers(column: Any) -> NDArray[np.float64]:
    values = column.to_numpy(zero_copy_only=False)
    if values.dtype.kind in "mM":
        missing = np.isnat(values)
        unit = "timedelta64[ns]" if values.dtype.kind == "m" else "datetime64[ns]"
        seconds = values.astype(unit).astype(np.int64) / 1e9
        return np.where(missing, np.nan, seconds)
    return np.asarray(values, np.float64)
