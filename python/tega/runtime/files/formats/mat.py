"""Open MATLAB's files up to version 7, with SciPy: matrices, sparse ones, and fields of structures and cells."""

from __future__ import annotations

import os
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from tega.errors import RecordingError
from tega.runtime.files.foreign_file import MIB
from tega.runtime.files.formats.named import open_arrays
from tega.runtime.files.tables.encoding import MOST_MIB
from tega.runtime.files.tables.table import Reading, Table
from tega.runtime.lifecycle import require

# The type of a compressed variable in a MATLAB 5 file.
_COMPRESSED = 15
_DEEPEST = 4
_MOST_FIELDS = 1000


def open_mat(path: Path, reading: Reading) -> Table:
    """Open a matrix of a MATLAB file; refused where no variable, or several, can be the samples."""
    io = require("scipy.io", driver="emg-file", extra="lab")
    try:
        _check_size(path)
        content: dict[str, Any] = io.loadmat(path, variable_names=[reading.variable])
        arrays = _flat({k: v for k, v in content.items() if not k.startswith("__")})
        if reading.variable not in arrays:
            content = io.loadmat(path)
            arrays = _flat({k: v for k, v in content.items() if not k.startswith("__")})
        else:
            arrays |= _scalars(io, path)
    except Exception as error:  # SciPy raises whatever the bytes lead it to
        raise RecordingError(f"{path.name}: not a MATLAB file: {error}", "export it again") from error
    return open_arrays(arrays, reading, path.name, "MAT")


def _scalars(io: Any, path: Path) -> dict[str, Any]:
    """Return the single numbers of a file, among which the rate may be."""
    try:
        names = [name for name, shape, _ in io.whosmat(path) if int(np.prod(shape)) == 1]
        return _flat(io.loadmat(path, variable_names=names)) if names else {}
    except (
        TypeError,
        ValueError,
    ):  # SciPy 1.17 lists nothing where an object of MATLAB lies beside the arrays
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


def _check_size(path: Path) -> None:
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
