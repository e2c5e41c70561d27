"""Open NumPy's own files: ``.npy`` and ``.npz``."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from tega.errors import RecordingError
from tega.runtime.files.foreign_file import MIB, load_npy
from tega.runtime.files.formats.named import open_arrays
from tega.runtime.files.tables.encoding import MOST_MIB
from tega.runtime.files.tables.table import MOST_JUDGED, Reading, Table, in_one, judged_columns, oriented


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
