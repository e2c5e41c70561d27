"""Store numbers of a recording on disk until they are needed: memory does not grow with its length."""

from __future__ import annotations

import tempfile
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from tega.errors import RecordingError

# Bytes up to which an array stays in memory: a short recording needs no file.
_HELD = 1 << 18


class Spool:
    """An array that grows in a temporary file, which is deleted with it; ``n`` is its length.

    Its methods raise ``RecordingError`` where the folder of temporary files has no room, or is not there.
    """

    def __init__(self, dtype: DTypeLike) -> None:
        self._dtype = np.dtype(dtype)
        self._file = tempfile.SpooledTemporaryFile(_HELD)  # noqa: SIM115 - it lives as long as this
        weakref.finalize(self, self._file.close)
        self.n = 0

    def add(self, items: NDArray[Any]) -> None:
        """Append items."""
        with _folder_named():
            self._file.seek(self.n * self._dtype.itemsize)
            self._file.write(items.tobytes())
        self.n += items.size

    def read(self, begin: int, end: int) -> NDArray[Any]:
        """Return the items from ``begin`` to before ``end``, read-only."""
        n_bytes = self._dtype.itemsize
        with _folder_named():
            self._file.seek(begin * n_bytes)
            return np.frombuffer(self._file.read((end - begin) * n_bytes), self._dtype)


@contextmanager
def _folder_named() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        folder = tempfile.tempdir or "temporary files"  # none can be used
        raise RecordingError(
            f"{folder}: {error.strerror or error}, where an export keeps some 250 MB an hour",
            "make room, or name a folder with more in the variable TMPDIR",
        ) from error
