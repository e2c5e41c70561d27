"""The bytes of a recording on their way to the disk.

A disk stands still at times: while it brings an earlier part of the file down, or since another program keeps it busy,
a write may take seconds, whatever thread does it. What waits meanwhile in a program's own memory is lost when that is
killed. So it waits in a folder in the machine's memory, which a kill does not reach; beside the unfinished file, in one
called ``….mcap.part.tail``, stands which, and whoever finishes the file takes it from there.
"""

from __future__ import annotations

import contextlib
import shutil
import tempfile
import threading
from collections import deque
from pathlib import Path
from typing import BinaryIO

__all__ = ["DirectFile", "SpooledFile", "open_disk", "take_tail"]

_TAIL = ".tail"
_MEMORY = Path("/dev/shm")  # where Linux keeps files in memory
_PREFIX = "tega-"
_PIECE_BYTES = 1024 * 1024


def open_disk(raw: BinaryIO, path: Path, *, most_bytes: int) -> DirectFile | SpooledFile:
    """Return what a recording is written through: by way of memory where the system has such a folder.

    Args:
        raw: The file, opened for writing without a buffer.
        path: Where it is.
        most_bytes: What may wait in memory.
    """
    if raw.seekable() and _MEMORY.is_dir():
        with contextlib.suppress(OSError):
            return SpooledFile(raw, path, most_bytes=most_bytes)
    return DirectFile(raw)


class DirectFile:
    """A file that is written at once. After the first error it takes everything and keeps nothing.

    The writer of the SDK would otherwise try again with every message; whoever owns this looks at :attr:`error`.

    Args:
        raw: The file, opened for writing without a buffer.

    Attributes:
        n_bytes: Bytes taken.
        error: Why the file cannot be written any more.
    """

    def __init__(self, raw: BinaryIO) -> None:
        self._raw = raw
        self.n_bytes = 0
        self.error: OSError | None = None

    def write(self, data: bytes) -> int:
        """Write, and return how much."""
        if self.error is None:
            try:
                _write(self._raw, data)
            except OSError as error:
                self.error = error
        self.n_bytes += len(data)
        return len(data)

    def seek(self, offset: int, whence: int = 0) -> int:
        """Return the place in the file, which cannot be changed."""
        return _place(self.n_bytes, offset, whence)

    def flush(self) -> None:
        """Do nothing: everything was written at once."""

    def close(self) -> None:
        """Do nothing, likewise."""


class SpooledFile:
    """A file that is written by a thread of its own; what that has not yet written outlives the process.

    Args:
        raw: The file, opened for writing without a buffer, empty.
        path: Where it is.
        most_bytes: What may wait in memory; with more, :meth:`flush` waits.

    Attributes:
        n_bytes: Bytes taken.
        error: Why the file cannot be written any more; from then on everything is taken and nothing kept.

    Raises:
        OSError: The folder in memory, or the note beside the file, cannot be made.
    """

    def __init__(self, raw: BinaryIO, path: Path, *, most_bytes: int) -> None:
        self._raw = raw
        self._most_bytes = most_bytes
        self._folder = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=_MEMORY))
        self._note = path.with_name(path.name + _TAIL)
        try:
            self._note.write_text(self._folder.name, encoding="utf-8")
        except OSError:
            self._folder.rmdir()
            raise
        self._buffer = bytearray()
        self._pieces: deque[tuple[int, int, bytes | None]] = deque()
        self._waiting_bytes = 0
        self._change = threading.Condition()
        self._closing = False
        self.n_bytes = 0
        self.error: OSError | None = None
        self._thread = threading.Thread(target=self._work, name="tega-recorder-disk", daemon=True)
        self._thread.start()

    def write(self, data: bytes) -> int:
        """Take, and return how much."""
        self._buffer += data
        self.n_bytes += len(data)
        if len(self._buffer) >= _PIECE_BYTES:
            self.flush()
        return len(data)

    def seek(self, offset: int, whence: int = 0) -> int:
        """Return the place in the file, which cannot be changed."""
        return _place(self.n_bytes, offset, whence)

    def flush(self) -> None:
        """Bring what was taken to where it outlives this process; waits only where memory is full."""
        data = bytes(self._buffer)
        self._buffer.clear()
        if not data or self.error is not None:
            return
        at = self.n_bytes - len(data)
        kept = self._keep(at, data)
        with self._change:
            self._pieces.append((at, len(data), None if kept else data))
            self._waiting_bytes += len(data)
            self._change.notify_all()
            most = self._most_bytes if kept else 0
            self._change.wait_for(lambda: self._waiting_bytes <= most or self.error is not None)

    def close(self) -> None:
        """Wait until all of it is written, and forget what was kept."""
        self.flush()
        with self._change:
            self._closing = True
            self._change.notify_all()
        self._thread.join()
        self._forget()

    def _forget(self) -> None:
        self._note.unlink(missing_ok=True)
        shutil.rmtree(self._folder, ignore_errors=True)

    def _piece(self, at: int) -> Path:
        return self._folder / f"{at:016d}"

    def _keep(self, at: int, data: bytes) -> bool:
        """Put a piece into memory, whole or not at all; return whether there was room."""
        new = self._folder / "new"
        try:
            new.write_bytes(data)
            new.replace(self._piece(at))
        except OSError:
            new.unlink(missing_ok=True)
            return False
        return True

    def _work(self) -> None:
        while True:
            with self._change:
                self._change.wait_for(lambda: self._pieces or self._closing)
                if not self._pieces:
                    return
                at, n_bytes, data = self._pieces.popleft()
            if self.error is None:
                try:
                    _write(self._raw, self._piece(at).read_bytes() if data is None else data)
                except OSError as error:
                    self.error = error
                    self._forget()
            self._piece(at).unlink(missing_ok=True)
            with self._change:
                self._waiting_bytes -= n_bytes
                self._change.notify_all()


def take_tail(part: Path) -> None:
    """Add to an unfinished file what its writer had not yet brought to the disk when it was killed.

    Args:
        part: The file; nobody else may be writing it.
    """
    note = part.with_name(part.name + _TAIL)
    if not note.exists():
        return
    folder = _MEMORY / note.read_text(encoding="utf-8").strip()
    # After a restart of the machine there is no such folder; and one that is not ours is left alone.
    if folder.parent == _MEMORY and folder.name.startswith(_PREFIX) and folder.is_dir():
        with part.open("r+b") as file:
            for piece in sorted(folder.glob("[0-9]*")):
                file.seek(int(piece.name))
                file.write(piece.read_bytes())
        shutil.rmtree(folder, ignore_errors=True)
    note.unlink()


def _write(raw: BinaryIO, data: bytes) -> None:
    left = memoryview(data)
    while left:
        left = left[raw.write(left) :]


def _place(n_bytes: int, offset: int, whence: int) -> int:
    at = (0, n_bytes, n_bytes)[whence] + offset
    if at != n_bytes:
        raise OSError("a recording is written from its beginning to its end")
    return at
