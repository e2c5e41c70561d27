"""Read a stack of pictures from an ``.npy`` or ``.npz`` file; put files of pictures into the order of their names."""

from __future__ import annotations

import re
import zipfile
from collections import Counter
from collections.abc import Sequence
from decimal import Decimal
from itertools import pairwise
from pathlib import Path
from typing import IO, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError
from tega.runtime.files.foreign_file import check_file, npy_header

_MOST_MIB: Final = 64 * 1024
_MOST_PIXELS: Final = 1 << 26
_MOST_TIMES: Final = 100_000_000
_UNITS: Final = {"t_s": 1.0, "t_ms": 1e-3, "t_us": 1e-6, "t_ns": 1e-9}
_REMEDY: Final = "save it with numpy.save as uint8 (n, height, width, 3) in blue, green, red"

# So few pictures with names of another kind are no part of the recording.
_STRAY_SHARE: Final = 0.1
_NUMBER: Final = r"(?:[0-9]+[.,][0-9]+(?![.,]?[0-9])|[0-9]+)"
# A decimal fraction has one point: 10.05.03 is three whole numbers.
_DECIMAL: Final = re.compile(rf"(?<![0-9.,])({_NUMBER})|([0-9]+)")
_WHOLE: Final = re.compile("[0-9]+")
_UNIX_UNITS: Final = {10: Decimal(1), 13: Decimal("1e-3"), 16: Decimal("1e-6"), 19: Decimal("1e-9")}
"""Unit of a time since 1970 by the digits that it has from 2001 to 2033, when the first of them is 1; seconds."""


class _Member(NamedTuple):
    """One array of a file: its name, shape and type, and whether it is in Fortran's order."""

    name: str
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    by_columns: bool


class PictureStack:
    """The pictures of an array in order; ``variable`` names it, ``""`` is the only one that holds pictures.

    ``times_s`` come from an array ``t_s``, ``t_ms``, ``t_us`` or ``t_ns`` beside them, seconds from the
    first; ``None`` without one. An array of another type or shape is refused.
    """

    def __init__(self, path: Path, *, variable: str = "") -> None:
        self._path = path
        try:
            check_file(path, most_mib=_MOST_MIB)
            self._archive = zipfile.ZipFile(path) if path.suffix.lower() == ".npz" else None
            members = self._members()
        except OSError as error:
            raise RecordingError(
                f"{path.name}: cannot be read: {error.strerror}", f"looked for {path}"
            ) from error
        except Exception as error:  # of a damaged file zipfile and NumPy raise what they like
            raise RecordingError(f"{path.name}: no array of pictures: {error}", _REMEDY) from error
        member = _chosen(members, variable, path)
        self.n_pictures, self._shape = member.shape[0], member.shape[1:]
        self.times_s = self._times_s(members)
        self._file, _ = self._open(member.name)
        self._n_read = 0

    def close(self) -> None:
        """Close the file."""
        self._file.close()
        if self._archive is not None:
            self._archive.close()

    def skip(self, n_pictures: int) -> None:
        """Pass over pictures."""
        n = min(n_pictures, self.n_pictures - self._n_read)
        self._n_read += n
        for _ in range(n):
            self._read_bytes()

    def read(self) -> NDArray[np.uint8] | None:
        """Return the next picture, uint8 (H, W, 3), colours as in the file; ``None`` after the last."""
        if self._n_read == self.n_pictures:
            return None
        self._n_read += 1
        image = np.frombuffer(self._read_bytes(), np.uint8).reshape(self._shape)
        return np.repeat(image[..., None], 3, axis=2) if image.ndim == 2 else image

    def _read_bytes(self) -> bytes:
        n_bytes = int(np.prod(self._shape))
        try:
            data = self._file.read(n_bytes)
        except Exception as error:  # as above
            raise RecordingError(
                f"{self._path.name}: damaged: {error}", "copy it again from its source"
            ) from error
        if len(data) < n_bytes:
            raise RecordingError(
                f"{self._path.name}: cut short at picture {self._n_read - 1} of {self.n_pictures}",
                "copy it again from its source",
            )
        return data

    def _members(self) -> list[_Member]:
        names = [""] if self._archive is None else self._archive.namelist()
        found = []
        for name in names:
            file, member = self._open(name)
            file.close()
            found.append(member)
        return found

    def _open(self, name: str) -> tuple[IO[bytes], _Member]:
        file = self._path.open("rb") if self._archive is None else self._archive.open(name)
        try:
            shape, by_columns, dtype = npy_header(file)
        except BaseException:
            file.close()
            raise
        return file, _Member(name, shape, dtype, by_columns)

    def _times_s(self, members: list[_Member]) -> list[float] | None:
        for one in members:
            unit = _UNITS.get(one.name.removesuffix(".npy"))
            if unit is None or one.shape != (self.n_pictures,) or one.dtype.kind not in "iuf":
                continue
            file, _ = self._open(one.name)
            with file:
                data = file.read(min(self.n_pictures, _MOST_TIMES) * one.dtype.itemsize)
            times = np.frombuffer(data, one.dtype)
            times_s = (times - times[0]).astype(np.float64) * unit if len(times) == self.n_pictures else times
            complete = np.isfinite(times_s).all() and len(times_s) >= self.n_pictures
            if not complete or (np.diff(times_s) <= 0).any():
                raise RecordingError(
                    f"{self._path.name}: the times in {one.name.removesuffix('.npy')!r} do not rise",
                    "leave them out, or mend them",
                )
            return [float(t_s) for t_s in times_s]
        return None


def _chosen(members: list[_Member], variable: str, path: Path) -> _Member:
    named = [one for one in members if one.name.removesuffix(".npy") == variable]
    fits = named if variable else [one for one in members if len(one.shape) >= 3]
    if len(fits) != 1:
        names = ", ".join(one.name.removesuffix(".npy") or path.name for one in members)
        text = f"no array {variable!r}" if variable else f"{len(fits)} arrays that could be pictures"
        raise RecordingError(f"{path.name}: {text} (it holds {names})"[:400], f"set variable; or {_REMEDY}")
    one = fits[0]
    shape = one.shape
    is_stack = len(shape) == 3 or (len(shape) == 4 and shape[3] == 3)
    if len(shape) == 4 and shape[1] == 3 and shape[3] != 3:
        hint = "put the colours last: numpy.transpose(pictures, (0, 2, 3, 1))"
    elif one.dtype.kind == "f":
        hint = "convert it: numpy.round(pictures * 255).astype(numpy.uint8), if it runs from 0 to 1"
    elif len(shape) == 3 and shape[2] == 3:
        hint, is_stack = "this is one picture; a recording has several", False
    elif one.by_columns:
        hint = "save it as numpy.ascontiguousarray(pictures)"
    else:
        hint = _REMEDY
    n_pixels = int(np.prod(shape[1:3], dtype=object)) if len(shape) > 2 else 0
    is_stack = is_stack and one.dtype == np.uint8 and not one.by_columns
    if not is_stack or not 0 < n_pixels <= _MOST_PIXELS or shape[0] < 1:
        raise RecordingError(
            f"{path.name}: holds {one.dtype} {shape}, expected uint8 (n, height, width, 3)", hint
        )
    return one


def sorted_names(files: Sequence[Path]) -> list[Path]:
    """Return files in the order of the numbers in their names, so that ``frame_2`` comes before ``frame_10``.

    ``1700000000.25`` comes before ``1700000000.5``: a number with one point is a decimal fraction. It is two whole
    numbers, so that ``1.9`` comes before ``1.10``, where one of several lengths ends in zero: no program prints a
    fraction so.
    """
    decimal = _are_decimals([path.stem for path in files])
    return sorted(files, key=lambda path: _key(path, decimal=decimal))


def without_strays(files: Sequence[Path]) -> tuple[list[Path], tuple[str, ...]]:
    """Return pictures without those named unlike nearly all others, and a sentence that names these, if any.

    As frames they would set the maximum.
    """
    shapes = {path: _DECIMAL.sub("#", path.stem.casefold()) for path in files}
    usual, n_usual = Counter(shapes.values()).most_common(1)[0]
    if n_usual == len(files) or len(files) - n_usual > _STRAY_SHARE * len(files):
        return list(files), ()
    strays = sorted(path.name for path, shape in shapes.items() if shape != usual)
    return [path for path, shape in shapes.items() if shape == usual], (
        f"{', '.join(strays[:3])}{' and others' if len(strays) > 3 else ''}: not named as the {n_usual} other pictures "
        f"({usual}), so not used; rename a file that is a frame",
    )


def name_times_s(stems: Sequence[str]) -> list[float] | None:
    """Return the times in the names of sorted pictures, seconds from the first.

    ``None`` where the longest numbers of the names are not all seconds, milliseconds, microseconds or
    nanoseconds since 1970, or do not rise.
    """
    if len(stems) < 2:
        return None
    numbers = [[one[0] or one[1] for one in _DECIMAL.findall(stem)] or [""] for stem in stems]
    found = [max(some, key=_n_whole_digits).replace(",", ".") for some in numbers]
    unit = _UNIX_UNITS.get(_n_whole_digits(found[0]))
    if unit is None or any(
        one[0] != "1" or _n_whole_digits(one) != _n_whole_digits(found[0]) for one in found
    ):
        return None
    times = [Decimal(one) for one in found]
    steps = [b - a for a, b in pairwise(times)]
    counts = all(step == 1 for step in steps)  # 1000000001, 1000000002 are numbers of pictures
    return None if counts or min(steps) <= 0 else [float((t - times[0]) * unit) for t in times]


def _n_whole_digits(number: str) -> int:
    return len(re.split("[.,]", number)[0])


def _are_decimals(stems: Sequence[str]) -> bool:
    numbers = [one[0] for stem in stems for one in _DECIMAL.findall(stem)]
    fractions = [part[1] for one in numbers if len(part := re.split("[.,]", one)) > 1]
    several = len({len(fraction) for fraction in fractions}) > 1
    return not (several and any(len(one) > 1 and one.endswith("0") for one in fractions))


def _key(path: Path, *, decimal: bool) -> list[tuple[int, Decimal, str]]:
    """Return a sort key in which the numbers of a name count as numbers."""
    key: list[tuple[int, Decimal, str]] = []
    at, stem = 0, path.stem.casefold()
    for found in (_DECIMAL if decimal else _WHOLE).finditer(stem):
        key += [(1, Decimal(0), stem[at : found.start()]), (0, Decimal(found[0].replace(",", ".")), "")]
        at = found.end()
    # Names equal but for case or leading zeros: the name itself decides, so that the order never depends on the disk.
    return [*key, (1, Decimal(0), stem[at:]), (2, Decimal(0), path.name)]
