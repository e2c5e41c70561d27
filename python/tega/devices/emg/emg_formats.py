"""Read EMG samples out of the files people have: text tables, .npy, .mat."""

from __future__ import annotations

import os
import re
import struct
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tega.errors import RecordingError
from tega.runtime.files.foreign_file import MIB, check_file, load_npy
from tega.runtime.lifecycle import require

if TYPE_CHECKING:
    from numpy.typing import NDArray


# What loggers call columns that are no muscle; a unit may follow in brackets or behind an underscore.
_OTHER = re.compile(
    r"(time|times|timestamp|time ?stamp|t|seconds|index|sample|samples|counter|force|forces|torque|load|grip|label|"
    r"trigger|marker|event|level)[ _]?(\[.*\]|\(.*\)|ms|us|ns|s|n|kg|nm|n\.m)?",
    re.IGNORECASE,
)

# An hour of 16 channels at 4 kHz as text has half of it.
_MOST_MIB = 4096

# The type of a compressed variable in a MATLAB 5 file.
_MAT_COMPRESSED = 15

# More columns than any amplifier TEGA knows has: such an array is lying on its side.
_MOST_CHANNELS = 512


def read_emg_file(
    path: Path, channels: Sequence[int] = (), *, variable: str = "emg"
) -> tuple[NDArray[np.float64], tuple[int, ...]]:
    """Read samples from a file.

    Text files hold one row of numbers per sample, separated by commas, semicolons, tabs or spaces, with an
    optional line of column names first; what follows ``#`` is a comment. Only the wanted columns have to be
    numbers.

    Args:
        path: The file; ``.mat`` and ``.npy`` by their suffix, anything else is text.
        channels: Columns to read, counted from 1; none means all.
        variable: Name of the array in a ``.mat`` file.

    Returns:
        Samples as float64 (n, channels), in the file's unit, and the numbers of the channels.

    Raises:
        RecordingError: The file is missing, cannot be parsed, holds no sample or lacks a channel.
        MissingExtraError: A ``.mat`` file needs SciPy.
    """
    if not path.exists() or path.is_dir():
        raise RecordingError(f"{path.name}: no such EMG file", f"looked for {path}")
    check_file(path, most_mib=_MOST_MIB)
    match path.suffix.lower():
        case ".mat":
            samples = _columns(path, _read_mat(path, variable), channels)
        case ".npy":
            samples = _columns(path, _read_npy(path), channels)
        case _:
            samples = _read_text(path, channels)
    if len(samples) == 0:
        raise RecordingError(f"{path.name}: holds no sample", "one row of numbers per sample is expected")
    return samples, tuple(channels) or tuple(range(1, samples.shape[1] + 1))


def _read_npy(path: Path) -> Any:
    return load_npy(path.read_bytes(), path.name)


def _read_mat(path: Path, variable: str) -> Any:
    io = require("scipy.io", driver="emg-file", extra="lab")
    try:
        _check_mat_size(path)
        content = io.loadmat(path, variable_names=[variable])
        names = [] if variable in content else _mat_names(io, path)
    except NotImplementedError as error:
        raise RecordingError(
            f"{path.name}: a MATLAB 7.3 file, which is not read", "save it again with: save(file, '-v7')"
        ) from error
    except Exception as error:  # SciPy raises whatever the bytes lead it to
        raise RecordingError(f"{path.name}: not a MATLAB file: {error}", "export it again") from error
    if variable not in content:
        raise RecordingError(
            f"{path.name}: has no variable {variable!r}",
            f"it has: {', '.join(names) or 'none that can be listed'}; name one of them as the variable",
        )
    return content[variable]


def _mat_names(io: Any, path: Path) -> list[str]:
    try:
        return sorted(name for name, _, _ in io.whosmat(path))
    except (
        TypeError
    ):  # SciPy 1.17 lists nothing where a MATLAB object, such as a table, lies beside the arrays
        return []


def _check_mat_size(path: Path) -> None:
    """Refuse a MATLAB 5 file whose compressed variables grow beyond what is read, whatever sizes its header tells.

    Raises:
        ValueError: A variable is too large.
        zlib.error: A variable is damaged.
    """
    with path.open("rb") as file:
        order = {b"IM": "<", b"MI": ">"}.get(file.read(128)[126:])
        left = _MOST_MIB * MIB
        while order and len(tag := file.read(8)) == 8:
            kind, n_bytes = struct.unpack(order + "II", tag)
            if kind != _MAT_COMPRESSED:
                file.seek(n_bytes, os.SEEK_CUR)
                continue
            packed, inflate = file.read(n_bytes), zlib.decompressobj()
            while packed and not inflate.eof:
                left -= len(inflate.decompress(packed, MIB))
                if left < 0:
                    raise ValueError(f"a variable of more than {_MOST_MIB} MiB")
                packed = inflate.unconsumed_tail


def _columns(path: Path, array: Any, channels: Sequence[int]) -> NDArray[np.float64]:
    """Check an array and take the wanted columns of it."""
    array = np.asarray(array)
    if array.dtype.kind not in "iuf":
        raise RecordingError(
            f"{path.name}: holds {array.dtype}, expected real numbers", "export the samples alone"
        )
    if array.ndim == 1:
        array = array[:, None]
    if array.ndim != 2:
        raise RecordingError(
            f"{path.name}: an array of shape {array.shape}, expected (samples, channels)",
            "export it as a table",
        )
    if array.shape[0] == 1 and array.shape[1] > _MOST_CHANNELS:
        array = array.T  # a plain vector is one channel, however it was stored
    if array.shape[0] < array.shape[1] and (
        array.shape[1] > _MOST_CHANNELS or max(channels, default=0) > array.shape[1]
    ):
        raise RecordingError(
            f"{path.name}: {array.shape[0]} samples of {array.shape[1]} channels",
            "rows are samples; if this one has channels as rows, save it transposed",
        )
    _check_channels(path, channels, array.shape[1])
    picked = array[:, [c - 1 for c in channels]] if channels else array
    return np.ascontiguousarray(picked, np.float64)


def _check_channels(path: Path, channels: Sequence[int], n_columns: int) -> None:
    for c in channels:
        if not 1 <= c <= n_columns:
            raise RecordingError(
                f"{path.name}: has no channel {c}", f"it has {n_columns}; channels are counted from 1"
            )
    if len(set(channels)) != len(channels):
        raise RecordingError(
            f"{path.name}: a channel is asked for twice in {', '.join(map(str, channels))}",
            "name each channel once",
        )


def _read_text(path: Path, channels: Sequence[int]) -> NDArray[np.float64]:
    try:
        text = path.read_text(encoding="utf-8-sig")  # its size has been looked at
    except UnicodeDecodeError as error:
        raise RecordingError(
            f"{path.name}: not text: byte {error.start} is {error.object[error.start]:#04x}",
            "give a table of numbers, .npy or .mat",
        ) from error
    values: list[float] = []
    columns: list[int] = [c - 1 for c in channels]
    delimiter: str | None = None
    n_fields = 0
    header_allowed = True
    for number, raw in enumerate(text.split("\n"), start=1):
        line = raw.partition("#")[0].strip()
        if not line:
            continue
        if n_fields == 0:
            delimiter = _delimiter(line)
        fields = _split(line, delimiter)
        if n_fields == 0 and header_allowed and _is_header(fields, columns):
            header_allowed = False
            _check_names(path, fields, columns)
            continue
        if n_fields == 0:
            n_fields = len(fields)
            _check_channels(path, channels, n_fields)
            columns = columns or list(range(n_fields))
        if len(fields) != n_fields:
            raise RecordingError(
                f"{path.name}:{number}: {len(fields)} fields, the lines before have {n_fields}: {_shown(line)}",
                "mend or delete that line",
            )
        try:
            values.extend([_number(fields[c]) for c in columns])
        except ValueError as error:
            raise RecordingError(
                f"{path.name}:{number}: not a row of numbers: {_shown(line)}",
                "mend or delete that line, or name the channels to read without its column",
            ) from error
    return np.array(values, np.float64).reshape(-1, max(len(columns), 1))


def _delimiter(line: str) -> str | None:
    return next((d for d in (";", ",", "\t") if d in line), None)


def _split(line: str, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return line.split()
    fields = line.split(delimiter)
    # Serial loggers like to end a line with a separator.
    return fields[:-1] if len(fields) > 1 and not fields[-1].strip() else fields


def _number(field: str) -> float:
    if "_" in field:
        raise ValueError(field)
    return float(field)


def _is_header(fields: list[str], columns: list[int]) -> bool:
    wanted = [fields[c] for c in columns if c < len(fields)] or fields
    try:
        for field in wanted:
            _number(field)
    except ValueError:
        # A line of names has no number where the samples are; one with some is a damaged row.
        return not any(_is_number(f) for f in wanted)
    return False


def _check_names(path: Path, names: list[str], columns: list[int]) -> None:
    """Refuse to take a column for EMG whose own name says that it is something else, unless it is asked for."""
    others = [n for n, name in enumerate(names, start=1) if _OTHER.fullmatch(name.strip())]
    if columns or not others:
        return
    named = ", ".join(f"{n} ({names[n - 1].strip()})" for n in others)
    rest = ",".join(str(n) for n in range(1, len(names) + 1) if n not in others) or "none"
    raise RecordingError(
        f"{path.name}: column {named} is no EMG by its name, and all columns would be read as channels",
        f"name the channels: {rest}",
    )


def _is_number(field: str) -> bool:
    try:
        _number(field)
    except ValueError:
        return False
    return True


def _shown(line: str) -> str:
    return repr(line if len(line) <= 60 else line[:57] + "...")
