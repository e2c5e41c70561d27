"""Write a recording's bytes to disk by way of memory that outlives a killed program.

A disk stalls at times: while it writes an earlier part of the file, or while another program keeps it busy, a write
may take seconds in any thread. Bytes that wait in a program's own memory are lost when it is killed. They therefore
wait in a folder in the machine's memory, which survives a kill. A file called ``….mcap.part.tail`` beside the
unfinished file names this folder, and the program that finishes the file takes the bytes from there. The folder names
the file that it belongs to and is locked while the file is written, so a copy of the file takes nothing from it.
Bytes that were never taken go to their file when the next recording begins.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import sys
import tempfile
import threading
import time
from collections import deque
from pathlib import Path
from typing import Any, BinaryIO

from tega.errors import RecordingError, UnsafeNameError
from tega.runtime.files.foreign_file import parse_json, plain_name, read_words
from tega.runtime.files.whole_file import lock_file, write_whole

_TAIL = ".tail"
_MEMORY = Path("/dev/shm")  # where Linux keeps files in memory
_PREFIX = "tega-"
_OWNER = "owner"
_PIECE_BYTES = 1024 * 1024
# A folder whose file cannot be found is kept for so long: its disk may be mounted again.
_KEPT_S = 86_400.0


def open_disk(raw: BinaryIO, path: Path, *, most_bytes: int) -> DirectFile | SpooledFile:
    """Return the file to write a recording through: by way of memory where the system has such a folder.

    ``raw`` is opened for writing without a buffer; at most ``most_bytes`` wait in memory.
    """
    if raw.seekable() and _MEMORY.is_dir():
        rescue_tails()
        with contextlib.suppress(OSError):
            return SpooledFile(raw, path, most_bytes=most_bytes)
    return DirectFile(raw)


class DirectFile:
    """A file that is written at once. After the first error it takes everything and keeps nothing.

    The writer of the SDK would otherwise retry with every message; the owner checks :attr:`error`, the reason
    why the file cannot be written any more. ``raw`` is opened for writing without a buffer.
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
        """Do nothing: everything was written at once."""


class SpooledFile:
    """A file that is written by a thread of its own; bytes not written yet outlive the process.

    ``raw`` is opened for writing without a buffer, and empty. :meth:`flush` waits while more than
    ``most_bytes`` are in memory. From an ``error`` on everything is discarded. ``OSError`` where the folder
    in memory, or the note beside the file, cannot be made.
    """

    def __init__(self, raw: BinaryIO, path: Path, *, most_bytes: int) -> None:
        self._raw = raw
        self._most_bytes = most_bytes
        own = os.fstat(raw.fileno())
        self._folder = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=_MEMORY))
        self._note = path.with_name(path.name + _TAIL)
        try:
            self._owner = (self._folder / _OWNER).open("xb")
            lock_file(self._owner, self._folder / _OWNER)
            owner = {"path": str(path.absolute()), "file": [own.st_dev, own.st_ino]}
            self._owner.write(json.dumps(owner).encode())
            self._owner.flush()
            write_whole(self._note, self._folder.name)
        except OSError:
            shutil.rmtree(self._folder, ignore_errors=True)
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
        """Move the buffered bytes to where they outlive this process; waits only if memory is full."""
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
        """Wait until everything is written, and discard the buffer."""
        self.flush()
        with self._change:
            self._closing = True
            self._change.notify_all()
        self._thread.join()
        self._forget()

    def _forget(self) -> None:
        self._note.unlink(missing_ok=True)
        shutil.rmtree(self._folder, ignore_errors=True)
        self._owner.close()

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
    """Append to an unfinished file the bytes that its killed writer had not yet brought to the disk.

    No other program may be writing it. A copy of it gets nothing, and takes nothing away from the original.
    """
    note = part.with_name(part.name + _TAIL)
    if not note.exists():
        return
    # After a restart of the machine there is no such folder; and one that is not ours is left alone.
    with contextlib.suppress(RecordingError, UnsafeNameError, OSError, ValueError):
        name = plain_name(read_words(note).strip(), subject="folder", source=note.name)
        if name.startswith(_PREFIX):
            _bring(_MEMORY / name, part)
    note.unlink()


def rescue_tails() -> None:
    """Append the bytes that killed recordings left in memory to their files, so that the memory is freed."""
    for folder in _MEMORY.glob(f"{_PREFIX}*"):
        with contextlib.suppress(OSError, ValueError):
            part = Path(str(_owner(folder).get("path", "")))
            if part.is_file():
                with part.open("rb") as file:
                    if lock_file(file, part):
                        _bring(folder, part)
            elif time.time() - folder.stat().st_mtime > _KEPT_S and _abandoned(folder):
                shutil.rmtree(folder, ignore_errors=True)


def _bring(folder: Path, part: Path) -> None:
    """Move the bytes in a folder to their file, unless they are still being written or belong to another file."""
    own = part.stat()
    if _owner(folder).get("file") != [own.st_dev, own.st_ino] or not _abandoned(folder):
        return
    with part.open("r+b") as file:
        for piece in sorted(folder.glob("[0-9]*")):
            file.seek(int(piece.name))
            file.write(piece.read_bytes())
    shutil.rmtree(folder, ignore_errors=True)


def _owner(folder: Path) -> dict[str, Any]:
    """Return which file a folder belongs to; of other people's folders nothing is believed."""
    seen = folder.stat(follow_symlinks=False)
    if sys.platform == "win32" or not folder.is_dir() or folder.is_symlink() or seen.st_uid != os.getuid():
        raise ValueError(f"{folder.name} belongs to another user")
    return parse_json((folder / _OWNER).read_bytes(), dict[str, Any])


def _abandoned(folder: Path) -> bool:
    """Whether the program that filled a folder is gone."""
    with (folder / _OWNER).open("rb") as file:
        return lock_file(file, folder / _OWNER)


def _write(raw: BinaryIO, data: bytes) -> None:
    left = memoryview(data)
    while left:
        left = left[raw.write(left) :]


def _place(n_bytes: int, offset: int, whence: int) -> int:
    at = (0, n_bytes, n_bytes)[whence] + offset
    if at != n_bytes:
        raise OSError("a recording is written from its beginning to its end")
    return at
