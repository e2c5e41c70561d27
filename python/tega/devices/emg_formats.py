"""Reading EMG samples out of the files people have: text tables, .npy, .mat."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tega.devices.lifecycle import require
from tega.errors import RecordingError

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["read_emg_file"]

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
    if not path.is_file():
        raise RecordingError(f"{path.name}: no such EMG file", f"looked for {path}")
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
    try:
        return np.load(path, allow_pickle=False)
    except (ValueError, OSError, EOFError) as error:
        raise RecordingError(f"{path.name}: not an .npy array: {error}", "save it with numpy.save") from error


def _read_mat(path: Path, variable: str) -> Any:
    io = require("scipy.io", driver="emg-file", extra="lab")
    try:
        content = io.loadmat(path)
    except NotImplementedError as error:
        raise RecordingError(
            f"{path.name}: a MATLAB 7.3 file, which is not read", "save it again with: save(file, '-v7')"
        ) from error
    except Exception as error:  # SciPy raises whatever the bytes lead it to
        raise RecordingError(f"{path.name}: not a MATLAB file: {error}", "export it again") from error
    if variable not in content:
        names = sorted(n for n, v in content.items() if isinstance(v, np.ndarray) and not n.startswith("__"))
        raise RecordingError(
            f"{path.name}: has no variable {variable!r}",
            f"it has: {', '.join(names) or 'none'} (--emg-variable)",
        )
    return content[variable]


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
        text = path.read_text(encoding="utf-8-sig")
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
                "mend or delete that line, or leave its column out with --emg-channels",
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


def _is_number(field: str) -> bool:
    try:
        _number(field)
    except ValueError:
        return False
    return True


def _shown(line: str) -> str:
    return repr(line if len(line) <= 60 else line[:57] + "...")
