"""Open HDF5 files and MATLAB's of version 7.3 with h5py, MATLAB's up to version 7 with SciPy: matrices, fields, cells.

Nothing outside an HDF5 file is followed.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError
from tega.runtime.files.foreign_file import MIB
from tega.runtime.files.formats.named import add_clock, as_array, check_size, open_arrays, pick
from tega.runtime.files.tables.encoding import MOST_MIB
from tega.runtime.files.tables.table import (
    MOST_JUDGED,
    Reading,
    Table,
    in_one,
    judged_columns,
    oriented,
)
from tega.runtime.lifecycle import require

_MOST_DATASETS = 10_000
_ROWS = 65_536

# The type of a compressed variable in a MATLAB 5 file.
_COMPRESSED = 15
_DEEPEST = 4
_MOST_FIELDS = 1000


def open_hdf5(path: Path, reading: Reading, *, transposed: bool = False) -> Table:
    """Open a matrix or named fields of records; refused where no dataset or several can be the samples.

    ``transposed`` is whether a matrix lies there by columns.
    """
    h5py: Any = require("h5py", driver="emg-file", extra="formats")
    name = "MAT 7.3" if transposed else "HDF5"
    with h5py.File(path, "r") as file:
        datasets = _datasets(h5py, file)
        records = {key: one for key, one in datasets.items() if one.dtype.names}
        matrices = [
            one
            for one in datasets.values()
            if one.dtype.kind in "iuf" and one.ndim in {1, 2} and one.size > 1
        ]
        if len(records) == 1 and not matrices:
            return _records(path, *next(iter(records.items())))
        picked = pick(datasets, reading.variable, path.name)
        if picked.channels:
            return open_arrays(
                datasets | {k: np.asarray(file.attrs[k]) for k in file.attrs}, reading, path.name, name
            )
        dataset = picked.array
        numbers = dataset.ndim == 2 and dataset.dtype.kind in "iuf" and not transposed
        if numbers and reading.rows != "channels" and dataset.shape[0] >= dataset.shape[1] > 0:
            check_size(dataset, path.name)
            head = np.asarray(dataset[:MOST_JUDGED], np.float64)
            blocks = partial(_by_rows, h5py, path, picked.name)
            table = Table(path.name, name, judged_columns([], head), blocks)
            n_rows = len(dataset)
        else:
            array = as_array(dataset, path.name)
            array, sideways = oriented(array.T if transposed else array, path.name, rows=reading.rows)
            head = array[:MOST_JUDGED].astype(np.float64)
            table = Table(path.name, name, judged_columns([], head), in_one(array), sideways=sideways)
            n_rows = len(array)
        table.notes += [picked.note] if picked.note else []
        attributes: dict[str, Any] = {}
        clock = dataset.parent.get("starting_time", file)  # NWB's
        for owner in (dataset, dataset.parent, clock, file):
            attributes |= {key: np.asarray(owner.attrs[key]) for key in owner.attrs if key not in attributes}
        add_clock(table, datasets | attributes, picked.name, n_rows)
    return table


def _datasets(h5py: Any, file: Any) -> dict[str, Any]:
    """Return the datasets that lie in the file itself, by their paths."""
    found: dict[str, Any] = {}
    waiting: list[tuple[str, Any]] = [("", file)]
    seen = set()
    while waiting and len(found) < _MOST_DATASETS:
        path, group = waiting.pop()
        if group.id in seen:
            continue
        seen.add(group.id)
        for key in group:
            if key.startswith("#") or not isinstance(group.get(key, getlink=True), h5py.HardLink):
                continue
            item = group[key]
            if isinstance(item, h5py.Group):
                waiting.append((f"{path}{key}/", item))
                continue
            outside = not isinstance(item, h5py.Dataset) or item.is_virtual or item.external is not None
            if not outside and item.shape is not None:
                found[f"{path}{key}"] = item
    return found


def _by_rows(h5py: Any, path: Path, name: str, columns: Sequence[int]) -> Iterator[NDArray[np.float64]]:
    with h5py.File(path, "r") as file:
        dataset = file[name]
        for at in range(0, len(dataset), _ROWS):
            yield dataset[at : at + _ROWS][:, list(columns)]


open_mat73 = partial(open_hdf5, transposed=True)
"""Opens a matrix of a MATLAB file of version 7.3, which lies there by columns."""


def _records(path: Path, name: str, dataset: Any) -> Table:
    fields = [f for f in dataset.dtype.names if dataset.dtype[f].kind in "iuf" and not dataset.dtype[f].shape]
    if not fields or dataset.ndim != 1 or len(dataset) * len(fields) * 8 > MOST_MIB * 2**20:
        raise RecordingError(
            f"{path.name}: the records of {name!r} hold no plain numbers", "export it as CSV"
        )
    rows = dataset[()]
    array = np.column_stack([rows[f].astype(np.float64) for f in fields])
    return Table(path.name, "HDF5", judged_columns(fields, array[:MOST_JUDGED]), in_one(array))


def open_mat(path: Path, reading: Reading) -> Table:
    """Open a matrix of a MATLAB file; refused where no variable, or several, can be the samples."""
    io = require("scipy.io", driver="emg-file", extra="lab")
    try:
        _check_packed(path)
        arrays = _flat(io.loadmat(path, variable_names=[reading.variable]))
        arrays = arrays | _scalars(io, path) if reading.variable in arrays else _flat(io.loadmat(path))
    except Exception as error:  # SciPy raises whatever the bytes lead it to
        raise RecordingError(f"{path.name}: not a MATLAB file: {error}", "export it again") from error
    return open_arrays(arrays, reading, path.name, "MAT")


def _scalars(io: Any, path: Path) -> dict[str, Any]:
    try:
        names = [name for name, shape, _ in io.whosmat(path) if name == "datastart" or np.prod(shape) == 1]
        return _flat(io.loadmat(path, variable_names=names)) if names else {}
    except (TypeError, ValueError):
        # SciPy 1.17 lists nothing where an object of MATLAB lies beside the arrays.
        return {}


def _flat(content: dict[str, Any]) -> dict[str, Any]:
    """Return matrices by name, those of structures and cells with the path to them."""
    found: dict[str, Any] = {}
    waiting = [(name, value, 0) for name, value in content.items() if not name.startswith("__")]
    while waiting and len(found) < _MOST_FIELDS:
        name, value, depth = waiting.pop(0)
        dtype = getattr(value, "dtype", None)
        if dtype is None or depth > _DEEPEST:
            continue
        if dtype.names:
            fields = [(f"{name}.{f}", value[f].flat[0], depth + 1) for f in dtype.names if value.size == 1]
            waiting += fields
        elif dtype.kind == "O":
            cells = list(value.flat[:_MOST_FIELDS])
            waiting += [(f"{name}{{{k}}}", cell, depth + 1) for k, cell in enumerate(cells, start=1)]
        else:
            found[name] = value
    return found


def _check_packed(path: Path) -> None:
    """Refuse a file with compressed variables that grow beyond the limit, whatever its header states."""
    with path.open("rb") as file:
        order = {b"IM": "<", b"MI": ">"}.get(file.read(128)[126:])
        left = MOST_MIB * MIB
        while order and len(tag := file.read(8)) == 8:
            kind, n_bytes = struct.unpack(order + "II", tag)
            if kind != _COMPRESSED:
                file.seek(n_bytes, os.SEEK_CUR)
                continue
            packed, inflate = file.read(n_bytes), zlib.decompressobj()
            while packed and not inflate.eof:
                left -= len(inflate.decompress(packed, MIB))
                if left < 0:
                    raise ValueError(f"a variable of more than {MOST_MIB} MiB")
                packed = inflate.unconsumed_tail
