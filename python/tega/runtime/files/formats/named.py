"""Open NumPy's own files, and Parquet tables with pyarrow, a batch of rows at a time.

Among the arrays of a file with several, the samples, their rate and their time are chosen.
"""

from __future__ import annotations

import re
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError
from tega.runtime.files.foreign_file import MIB, load_npy
from tega.runtime.files.tables.encoding import MOST_MIB
from tega.runtime.files.tables.judging import SECONDS, judged, unix_unit
from tega.runtime.files.tables.table import (
    MOST_JUDGED,
    Reading,
    Table,
    in_one,
    judged_columns,
    oriented,
)
from tega.runtime.files.tables.timing import to_seconds
from tega.runtime.lifecycle import require

_RATE = re.compile(
    r"(?:emg)?_?(?:fs|sfreq|s?rate|rate_?hz|fsamp|freq|frequency|sampl\w*_?(?:rate|freq\w*|hz))(?:_?hz|_?emg)?",
    re.IGNORECASE,
)
_TIME = re.compile(r"(?:emg)?_?(?:t|time|times|time_?stamps?)(?:_?[mun]?s)?", re.IGNORECASE)
_MOST_LISTED = 12
_ROWS = 65_536


class Picked(NamedTuple):
    """Array that holds the samples; ``note`` is why it was picked, ``""`` for the one that was asked for.

    ``channels`` are the names of the arrays that it was put together from, a column each.
    """

    name: str
    array: Any
    note: str
    channels: tuple[str, ...] = ()


def pick(arrays: Mapping[str, Any], variable: str, file: str) -> Picked:
    """Return the array of samples among named ones; ``RecordingError`` where none or several can be meant.

    Arrays are anything with ``shape`` and ``dtype``; fields of a structure are behind a dot. The variable
    ``emg`` also stands for the only one that can be it, or for those of one dimension and length: a channel each.
    """
    if variable in arrays:
        return Picked(variable, arrays[variable], "")
    inside = {
        name: array for name, array in arrays.items() if name.startswith((f"{variable}.", f"{variable}/"))
    }
    tables = {name: array for name, array in (inside or arrays).items() if _is_table(array)}
    if not inside and variable != "emg":
        tables = {}
    named = {name: array for name, array in tables.items() if "emg" in _last(name).lower()}
    usable = {name: array for name, array in tables.items() if judged(_last(name)).role == "unknown"}
    for some in (named, usable):
        exact = {name: array for name, array in some.items() if _last(name).lower() == "emg"}
        found = exact if len(exact) == 1 else some
        if len(found) == 1:
            name, array = found.popitem()
            return Picked(name, array, f'the samples are "{name}"')
        shapes = {tuple(array.shape) for array in found.values()}
        if len(shapes) == 1 and np.prod(shape := shapes.pop()) == (n := max(shape)):
            check_size(np.broadcast_to(0.0, (n, len(found))), file)
            array = np.column_stack([as_array(array, file).ravel() for array in found.values()])
            note = f"the channels are {', '.join(map(repr, found))}"
            return Picked(next(iter(found)), array, note, tuple(map(_last, found)))
        if found:
            break
    listed = ", ".join(sorted(tables or arrays)[:_MOST_LISTED]) or "none that can be listed"
    raise RecordingError(
        f"{file}: several arrays can be {variable!r}"
        if len(tables) > 1
        else f"{file}: has no variable {variable!r}",
        f"it has: {listed}; name one of them: --variable, or emg.options.variable",
    )


def open_arrays(arrays: Mapping[str, Any], reading: Reading, file: str, format_name: str) -> Table:
    """Return a table of one of several arrays, with the rate and the time that stand beside it."""
    if "datastart" in arrays:  # of LabChart
        raise RecordingError(f"{file}: holds its channels behind each other", "export text from LabChart")
    picked = pick(arrays, reading.variable, file)
    array, sideways = oriented(as_array(picked.array, file), file, rows=reading.rows)
    columns = judged_columns(picked.channels, array[:MOST_JUDGED].astype(np.float64))
    table = Table(file, format_name, columns, in_one(array), sideways=sideways)
    table.notes += [picked.note] if picked.note else []
    add_clock(table, arrays, picked.name, len(array))
    return table


def as_array(value: Any, file: str) -> Any:
    """Return the numbers of an array, a sparse matrix or a dataset, unless they would not fit into memory."""
    check_size(value, file)
    if hasattr(value, "toarray"):
        return value.toarray()
    return value[()] if hasattr(value, "id") else np.asarray(value)


def check_size(value: Any, file: str) -> None:
    """Refuse an array or a dataset that is larger than is read."""
    shape = tuple(getattr(value, "shape", ()))
    if int(np.prod(shape, dtype=np.float64)) * 8 > MOST_MIB * 2**20:
        raise RecordingError(
            f"{file}: an array of shape {shape}, more than {MOST_MIB} MiB", "cut the recording"
        )


def add_clock(table: Table, arrays: Mapping[str, Any], name: str, n_rows: int) -> None:
    """Add the rate and the times that stand beside an array to its table: those of the same structure first."""
    for key in sorted(arrays, key=lambda other: (_parent(other) != _parent(name), other)):
        value, last = arrays[key], _last(key)
        size = int(np.prod(getattr(value, "shape", ()), dtype=np.float64))
        if table.rate_hz is None and size == 1 and _RATE.fullmatch(last):
            number = _number(value)
            if 1.0 <= number <= 1e7:
                table.rate_hz, table.rate_from = number, f'"{key}"'
        elif table.times_s is None and key != name and size == n_rows > 1 and _TIME.fullmatch(last):
            times = np.asarray(as_array(value, table.file)).ravel()
            if times.dtype.kind in "iuf" and _parent(key) == _parent(name):
                unit_s = SECONDS.get(unix_unit(times) or judged(last).unit.lower())
                table.times_s = to_seconds(times.astype(np.float64), unit_s, table.rate_hz)
                if table.times_s is None:
                    table.notes.append(f'"{key}" is not used as time: it does not rise by steps of any unit')


def _is_table(array: Any) -> bool:
    shape, dtype = getattr(array, "shape", ()), getattr(array, "dtype", None)
    return dtype is not None and dtype.kind in "iuf" and len(shape) <= 2 and max(shape, default=0) > 1


def _number(value: Any) -> float:
    try:
        return float(np.asarray(value[()] if hasattr(value, "id") else value).ravel()[0])
    except (TypeError, ValueError):
        return 0.0


def _last(name: str) -> str:
    return re.split(r"[./]", name)[-1]


def _parent(name: str) -> str:
    return name[: len(name) - len(_last(name))]


def open_npy(path: Path, reading: Reading) -> Table:
    """Open an array, (samples,), (samples, channels), or (channels, samples) where it can be nothing else."""
    array = load_npy(path.read_bytes(), path.name)
    names = array.dtype.names or ()
    if names:
        array = np.column_stack([array[name].ravel() for name in names])
    array, sideways = oriented(array, path.name, rows=reading.rows)
    columns = judged_columns(names, array[:MOST_JUDGED].astype(np.float64))
    return Table(path.name, "NumPy array", columns, in_one(array), sideways=sideways)


def open_npz(path: Path, reading: Reading) -> Table:
    """Open an archive of arrays; refused where none of them, or several, can be the samples."""
    arrays: dict[str, Any] = {}
    try:
        with zipfile.ZipFile(path) as archive:
            members = [one for one in archive.infolist() if one.filename.endswith(".npy")]
            if sum(one.file_size for one in members) > MOST_MIB * MIB:
                raise RecordingError(f"{path.name}: more than {MOST_MIB} MiB of arrays", "cut the recording")
            for one in members:
                with archive.open(one) as file:
                    content = file.read(one.file_size + 1)
                try:
                    arrays[one.filename.removesuffix(".npy")] = load_npy(content, one.filename)
                except RecordingError:  # an array of Python objects beside the samples
                    continue
    except (zipfile.BadZipFile, OSError, ValueError, EOFError, NotImplementedError, RuntimeError) as error:
        raise RecordingError(
            f"{path.name}: a damaged archive: {error}", "save it again with numpy.savez"
        ) from error
    return open_arrays(arrays, reading, path.name, "NumPy archive")


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
        head = np.full((min(MOST_JUDGED, file.metadata.num_rows), len(text)), np.nan)
        for batch in file.iter_batches(batch_size=MOST_JUDGED):
            for k in np.flatnonzero(np.logical_not(text)).tolist():
                head[: len(batch), k] = _seconds_or_numbers(batch.column(k))
            break
        columns = judged_columns(schema.names, head, text=text)
    for column, is_time in zip(columns, times, strict=True):
        if is_time:
            column.holds, column.unit, column.unix, column.why = "time", "s", "", "values"
    return Table(path.name, "Parquet", columns, partial(_by_batches, parquet, path))


def _by_batches(parquet: Any, path: Path, columns: Sequence[int]) -> Iterator[NDArray[np.float64]]:
    with parquet.ParquetFile(path) as file:
        for batch in file.iter_batches(batch_size=_ROWS):  # by numbers: several columns can have one name
            yield np.column_stack([_seconds_or_numbers(batch.column(k)) for k in columns])


def _seconds_or_numbers(column: Any) -> NDArray[np.float64]:
    values = column.to_numpy(zero_copy_only=False)
    if values.dtype.kind in "mM":
        missing = np.isnat(values)
        unit = "timedelta64[ns]" if values.dtype.kind == "m" else "datetime64[ns]"
        seconds = values.astype(unit).astype(np.int64) / 1e9
        return np.where(missing, np.nan, seconds)
    return np.asarray(values, np.float64)
