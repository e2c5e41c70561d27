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


class RecordingDisk:
    """A file that is written by a thread of its own; bytes not written yet outlive the process.

    ``raw`` is opened for writing without a buffer, and empty. :meth:`flush` waits while more than ``most_bytes`` are
    in memory; where the system has no such folder, or ``raw`` is a pipe, until all is written. From an ``error`` on
    everything is discarded: the writer of the SDK would otherwise retry with every message.
    """

    def __init__(self, raw: BinaryIO, path: Path, *, most_bytes: int) -> None:
        self._raw = raw
        self._most_bytes = most_bytes
        self._note = path.with_name(path.name + _TAIL)
        self._folder: Path | None = None
        self._owner: BinaryIO
        if raw.seekable() and _MEMORY.is_dir():
            rescue_tails()
            with contextlib.suppress(OSError):
                self._open_folder(path)
        self._buffer = bytearray()
        self._pieces = deque[tuple[Path | bytes, int]]()
        self._waiting_bytes = 0
        self._change = threading.Condition()
        self._closing = False
        self.n_bytes = 0
        self.error: OSError | None = None
        self._thread = threading.Thread(target=self._work, name="tega-recorder-disk", daemon=True)
        self._thread.start()

    def _open_folder(self, path: Path) -> None:
        own = os.fstat(self._raw.fileno())
        folder = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=_MEMORY))
        try:
            self._owner = (folder / _OWNER).open("xb")
            lock_file(self._owner, folder / _OWNER)
            owner = {"path": str(path.absolute()), "file": [own.st_dev, own.st_ino]}
            self._owner.write(json.dumps(owner).encode())
            self._owner.flush()
            write_whole(self._note, folder.name)
        except OSError:
            shutil.rmtree(folder, ignore_errors=True)
            raise
        self._folder = folder

    def write(self, data: bytes) -> int:
        """Take, and return how much."""
        self._buffer += data
        self.n_bytes += len(data)
        if len(self._buffer) >= _PIECE_BYTES:
            self.flush()
        return len(data)

    def seek(self, offset: int, whence: int = 0) -> int:
        """Return the place in the file, which cannot be changed."""
        if (0, self.n_bytes, self.n_bytes)[whence] + offset != self.n_bytes:
            raise OSError("a recording is written from its beginning to its end")
        return self.n_bytes

    def flush(self) -> None:
        """Move the buffered bytes to where they outlive this process; waits only if memory is full."""
        data = bytes(self._buffer)
        self._buffer.clear()
        if not data or self.error is not None:
            return
        piece = self._kept(data)
        with self._change:
            self._pieces.append((piece, len(data)))
            self._waiting_bytes += len(data)
            self._change.notify_all()
            most = self._most_bytes if isinstance(piece, Path) else 0
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
        if self._folder is not None:
            self._note.unlink(missing_ok=True)
            shutil.rmtree(self._folder, ignore_errors=True)
            self._owner.close()

    def _kept(self, data: bytes) -> Path | bytes:
        """Put the newest bytes into memory, whole or not at all; return their file, or the bytes without room."""
        if self._folder is None:
            return data
        new, piece = self._folder / "new", self._folder / f"{self.n_bytes - len(data):016d}"
        try:
            new.write_bytes(data)
            new.replace(piece)
        except OSError:
            new.unlink(missing_ok=True)
            return data
        return piece

    def _work(self) -> None:
        while True:
            with self._change:
                self._change.wait_for(lambda: self._pieces or self._closing)
                if not self._pieces:
                    return
                piece, n_bytes = self._pieces.popleft()
            if self.error is None:
                try:
                    left = memoryview(piece.read_bytes() if isinstance(piece, Path) else piece)
                    while left:
                        left = left[self._raw.write(left) :]
                except OSError as error:
                    self.error = error
                    self._forget()
            if isinstance(piece, Path):
                piece.unlink(missing_ok=True)
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
