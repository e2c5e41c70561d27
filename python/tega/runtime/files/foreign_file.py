"""Read files of unknown origin: never wait for a pipe, trust no stated size, report every fault.

Every reader of recordings, settings and tables goes through here; each says how large its files can be at most.

A recording, a study's folder, a plan or a message can hold any text where a name is expected: ``/etc/passwd``,
``../../.ssh/authorized_keys``, ``C:x``. Every such text goes through :func:`plain_name` before it becomes the name of a
file or folder.
"""

from __future__ import annotations

import functools
import io
import math
import re
import stat
import tomllib
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Final, ParamSpec, TypeVar

import msgspec

from tega.errors import RecordingError, TegaError, UnsafeNameError
from tega.runtime.files.toml_text import tree_values

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

LONGEST_NAME = 128
"""Characters that a name may have, of the 255 bytes that file systems take: endings are added to it."""

_PLAIN = re.compile(rf"[A-Za-z0-9_][A-Za-z0-9._+-]{{0,{LONGEST_NAME - 1}}}")
# Windows opens a device under these names, whatever ending they have.
_DEVICES = re.compile(r"(CON|PRN|AUX|NUL|COM[0-9]|LPT[0-9])(\..*)?", re.IGNORECASE)


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
        tree = tomllib.loads(text)
        deque(tree_values(tree), 0)  # as deep by dotted keys, which are no recursion of the parser
    except tomllib.TOMLDecodeError:
        raise
    except (RecursionError, ValueError) as error:
        what = "tables or arrays lie in each other hundreds deep, or a number has thousands of digits"
        raise tomllib.TOMLDecodeError(what) from error
    return tree


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
    shape, by_columns, dtype = npy_header(file)
    if dtype.hasobject:
        raise ValueError("it holds Python objects, which are never read")
    n_bytes, n_there = math.prod(shape) * dtype.itemsize, len(data) - file.tell()
    if min(shape, default=0) < 0 or n_bytes > n_there:
        raise ValueError(f"cut short: {n_there} bytes of {n_bytes}")
    array = np.frombuffer(data, dtype, math.prod(shape), file.tell()) if n_bytes else np.empty(0, dtype)
    return array.reshape(shape, order="F" if by_columns else "C").copy(order="K")


def npy_header(file: IO[bytes]) -> tuple[tuple[int, ...], bool, Any]:
    """Read the header of an ``.npy`` file: the array's shape, whether it is in Fortran's order, and its type."""
    from numpy.lib import format as npy

    version = npy.read_magic(file)
    if version not in {(1, 0), (2, 0)}:
        raise ValueError(f"version {version} of the format")
    return (npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0)(file)


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


def plain_name(name: str, *, subject: str, source: str) -> str:
    """Return a name from outside, which can only name something inside the folder that it is joined to.

    It has 1 to 128 ASCII letters, digits, dots, dashes, underscores and pluses, no dot or dash in front, no dot
    at the end, and is none of Windows' device names; else ``UnsafeNameError`` with ``subject``, the kind of
    thing that it names, and ``source``, the file or message that it stands in.

    Example:
        >>> plain_name("baseline-thumb.npy", subject="attachment", source="trial-001.mcap")
        'baseline-thumb.npy'
    """
    if not _PLAIN.fullmatch(name) or name.endswith(".") or _DEVICES.fullmatch(name):
        displayed = repr(name if len(name) <= LONGEST_NAME else name[:LONGEST_NAME] + "…")
        raise UnsafeNameError(
            f"{source}: {subject} {displayed} cannot be the name of a file",
            f"nothing was written there; a name has 1 to {LONGEST_NAME} letters a to z, digits, '.', '-', '_', '+'",
        )
    return name


def path_below(folder: Path, name: str, *, subject: str, source: str) -> Path:
    """Return the path of something below a folder, from a name such as ``gels/D20982/before.png``.

    Each part has to be a name as for :func:`plain_name`, else the path might lie outside of the folder.
    """
    return folder.joinpath(*(plain_name(part, subject=subject, source=source) for part in name.split("/")))
