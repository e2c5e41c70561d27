"""Read files of unknown origin: never wait for a pipe, trust no stated size, report every fault.

Every reader of recordings, settings and tables goes through here; each says how large its files can be at most.
"""

from __future__ import annotations

import functools
import io
import math
import stat
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, ParamSpec, TypeVar

import msgspec

from tega.errors import RecordingError, TegaError

if TYPE_CHECKING:
    from numpy.typing import NDArray


MIB: Final = 1024 * 1024

_P = ParamSpec("_P")
_R = TypeVar("_R")

_KINDS = (
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
    (stat.S_ISSOCK, "a socket"),
)


def check_file(path: Path, *, most_mib: int, error: type[TegaError] = RecordingError) -> None:
    """Raise ``error`` for anything but a regular file, which might never end, and above ``most_mib`` MiB.

    A folder or a missing file is left to the caller to detect; ``OSError`` where it cannot be looked at.
    """
    there = path.stat()
    for is_kind, name in _KINDS:
        if is_kind(there.st_mode):
            raise error(
                f"{path.name}: is {name}, not a file", "copy its output into a file, and name that file"
            )
    if there.st_size > most_mib * MIB:
        raise error(
            f"{path.name}: {there.st_size / MIB:.0f} MiB, at most {most_mib} MiB are read",
            "is it the right file? a recording is cut with trim",
        )


def read_foreign(path: Path, *, most_mib: int, error: type[TegaError] = RecordingError) -> bytes:
    """Return a file's content; arguments and errors as in :func:`check_file`."""
    check_file(path, most_mib=most_mib, error=error)
    return path.read_bytes()


def read_words(path: Path, *, most_mib: int = 1, error: type[TegaError] = RecordingError) -> str:
    """Return a UTF-8 file's text without a byte order mark; errors as above, or ``UnicodeDecodeError``."""
    return read_foreign(path, most_mib=most_mib, error=error).decode("utf-8-sig").replace("\r\n", "\n")


def parse_toml(text: str) -> dict[str, Any]:
    """Return the tree of a TOML text; ``ValueError`` also for one deeper than anything that is meant."""
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise tomllib.TOMLDecodeError("tables or arrays lie in each other hundreds deep") from error


def parse_json(data: bytes | str, kind: type[_R]) -> _R:
    """Return the value of a JSON text, of the type that is asked for.

    ``msgspec.DecodeError`` where it is no JSON or no UTF-8, of another type, or deeper than anything that is
    meant.
    """
    try:
        return msgspec.json.decode(data, type=kind)
    except UnicodeDecodeError as error:
        raise msgspec.DecodeError(f"no UTF-8: {error}") from error
    except RecursionError as error:  # msgspec goes as deep as Python allows, then raises this
        raise msgspec.DecodeError("objects or arrays lie in each other hundreds deep") from error


def load_npy(data: bytes, name: str) -> NDArray[Any]:
    """Return the array of an ``.npy`` file's content; its header is believed only as far as there are bytes.

    An array that is cut short or made of Python objects is a ``RecordingError`` about ``name``.
    """
    try:
        return _array(data)
    except Exception as error:  # a damaged header raises whatever Python's own parser does
        raise RecordingError(f"{name}: not an .npy array: {error}", "save it with numpy.save") from error


def _array(data: bytes) -> NDArray[Any]:
    import numpy as np

    file = io.BytesIO(data)
    version = np.lib.format.read_magic(file)
    if version not in {(1, 0), (2, 0)}:
        raise ValueError(f"version {version} of the format")
    first = version == (1, 0)
    read_header = np.lib.format.read_array_header_1_0 if first else np.lib.format.read_array_header_2_0
    shape, by_columns, dtype = read_header(file)
    if dtype.hasobject:
        raise ValueError("it holds Python objects, which are never read")
    n_bytes = math.prod(shape) * dtype.itemsize
    if min(shape, default=0) < 0 or n_bytes > len(data) - file.tell():
        raise ValueError(f"cut short: {len(data) - file.tell()} bytes of {n_bytes}")
    array = np.frombuffer(data, dtype, math.prod(shape), file.tell()) if n_bytes else np.empty(0, dtype)
    return array.reshape(shape, order="F" if by_columns else "C").copy(order="K")


def reports_damage(read: Callable[_P, _R]) -> Callable[_P, _R]:
    """Make a function that reads a recording (its first argument) report all damage as one error.

    A file with a valid format can still hold anything: a topic of another type, a frame of another size, a number in
    place of a name. Errors that result from it count as damage of the file.
    """

    @functools.wraps(read)
    def reported(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        try:
            return read(*args, **kwargs)
        except (TegaError, OSError):
            raise
        except Exception as error:
            first = args[0] if args else next(iter(kwargs.values()), "")
            name = first.name if isinstance(first, Path) else "the recording"
            raise RecordingError(
                f"{name}: damaged, or not written by TEGA: {type(error).__name__}: {str(error)[:200]}",
                "inspect says how far it can be read; --debug shows where it ended",
            ) from error

    return reported
