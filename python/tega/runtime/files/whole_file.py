"""Write a file whole or not at all, or add to it, and never change another file than the one named; keep a journal.

A folder of unknown origin can hold a link in the place of any file that a program creates beside its own; writing
through it would change the link's target. A file that is written whole is a new file, which then replaces the old
file or link; a file that is appended to is opened without following links. A file that is being written can be marked.

A journal has one JSON object a line, appended and synced one by one, never changed. An entry is kept once
:meth:`JsonLines.append` has returned, whatever happens to the program or the machine then. A last line that a crash has
cut off was never promised, and goes when the file is opened again.
"""

from __future__ import annotations

import os
import stat
import sys
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, BinaryIO, Final, Generic, Self, TypeVar

import msgspec

from tega.errors import DeviceUnavailableError, RecordingError
from tega.runtime.files.foreign_file import check_file, parse_json, read_foreign

Entry = TypeVar("Entry", bound=msgspec.Struct)

# Windows has neither such links nor such pipes, and Linux needs no flag for bytes.
_APPENDS: Final = os.O_RDWR | os.O_APPEND | os.O_CREAT
_GUARDED: Final[int] = sum(
    getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY", "O_CLOEXEC")
)

LOCK_SUFFIX: Final = ".lock"

_MOST_MIB = 256
_RESTORE = "restore the file from a copy"

# A lock of Windows keeps others from reading what is locked, and a recording is looked at while it grows.
_KEEPS_READERS_OUT = sys.platform == "win32"


@contextmanager
def new_file(path: Path, *, sync: bool = False) -> Iterator[BinaryIO]:
    """Open a new file that takes a path's place when the block ends, and is gone where an error ends it.

    A link there is replaced, not followed. With ``sync`` it is on the disk before, to outlive a loss of power.
    """
    beside = path.with_name(f".{path.name}.{os.getpid()}.new")
    beside.unlink(missing_ok=True)
    try:
        with beside.open("xb") as file:  # made new, or not at all: never through a link
            yield file
            if sync:
                file.flush()
                os.fsync(file.fileno())
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)


def write_whole(path: Path, data: bytes | str, *, sync: bool = False) -> None:
    """Write a file; its folder is made if need be."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with new_file(path, sync=sync) as file:
        file.write(data.encode() if isinstance(data, str) else data)


def open_to_append(path: Path) -> IO[bytes]:
    """Open a file, not a link, to read it and to add to it; it is made if need be, but not its folder."""
    refused = RecordingError(
        f"{path.name}: is a link, or no file, and is not written to", f"see what {path} is, and move it away"
    )
    try:
        handle = os.open(path, _APPENDS | _GUARDED, 0o666)
    except OSError as error:
        if path.is_symlink() or (path.exists() and not path.is_file()):
            raise refused from error
        raise
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        os.close(handle)
        raise refused
    return os.fdopen(handle, "ab+")


def lock_file(file: IO[bytes], path: Path) -> bool:
    """Mark an open file as being written, for as long as it is open; the mark dies with the process.

    Where a lock would keep readers out, it is an empty file beside it that is locked, with
    :data:`LOCK_SUFFIX` behind its name; that one stays locked until ``file`` is dropped. True if no other
    process has marked it, and on a file system without locks.
    """
    from filelock import lock_descriptor

    marked = file
    if _KEEPS_READERS_OUT:
        marked = path.with_name(path.name + LOCK_SUFFIX).open("ab")
        weakref.finalize(file, marked.close)
    try:
        return lock_descriptor(marked.fileno(), blocking=False)
    except OSError:
        return True


def read_json_lines(path: Path, kind: type[Entry], subject: str) -> list[Entry]:
    """Read a journal; a last line that was cut off is passed over, a missing file holds none.

    A field ``n`` of ``kind`` counts the lines from 1; missing lines are refused. ``subject`` names an entry,
    such as ``event``.
    """
    return _parse(read_foreign(path, most_mib=_MOST_MIB), path, kind, subject)[0] if path.exists() else []


def _parse(content: bytes, path: Path, kind: type[Entry], subject: str) -> tuple[list[Entry], int]:
    """Return the entries, and how many bytes of the file they take, a missing last newline not counted."""
    entries: list[Entry] = []
    good = 0
    *whole, last = content.split(b"\n")
    for number, line in enumerate([*whole, last] if last else whole, start=1):
        try:
            entry = parse_json(line, kind)
        except msgspec.DecodeError as error:
            if number > len(whole):  # no newline behind it: its program was stopped there
                break
            raise RecordingError(f"{path}: line {number} is no {subject}: {error}", _RESTORE) from error
        count = getattr(entry, "n", number)
        if count != number:
            raise RecordingError(
                f"{path}: line {number} holds {subject} {count}, so lines were taken out or put in", _RESTORE
            )
        entries.append(entry)
        good += len(line) + (number <= len(whole))
    return entries, good


class JsonLines(Generic[Entry]):
    """A journal, open to be added to; one program at a time. The file and its folder are made where missing.

    ``kind`` and ``subject`` are those of :func:`read_json_lines`. Where another program has the file open,
    this is ``DeviceUnavailableError`` with ``taken``, message and hint; ``RecordingError`` where the file is
    a link or holds something else.
    """

    def __init__(self, path: Path, kind: type[Entry], subject: str, *, taken: tuple[str, str]) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        new = not path.exists()
        if not new:
            check_file(path, most_mib=_MOST_MIB)
        self._path = path
        self._file: IO[bytes] = open_to_append(path)
        try:
            if not lock_file(self._file, path):
                raise DeviceUnavailableError(*taken)  # noqa: TRY301  # the file is closed below
            self._file.seek(0)
            content = self._file.read()
            self.entries, good = _parse(content, path, kind, subject)
            if good < len(content):
                self._file.truncate(good)
            if good and content[good - 1 : good] != b"\n":  # stopped between an entry and its newline
                self._put(b"\n")
            if new:
                _sync_folder(path.parent)
        except BaseException:
            self.close()
            raise

    def append(self, entry: Entry) -> Entry:
        """Add an entry and return it; when this returns it is on the disk."""
        self._put(msgspec.json.encode(entry) + b"\n")
        self.entries.append(entry)
        return entry

    def _put(self, content: bytes) -> None:
        if self._file.closed:
            raise RecordingError(f"{self._path}: is closed", "open the journal again")
        self._file.write(content)
        self._file.flush()
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close the file; closing twice does nothing."""
        self._file.close()

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *_error: object) -> None:
        """Close the file."""
        self.close()


def _sync_folder(folder: Path) -> None:
    """Make sure that the file's name is on the disk too, where folders can be synced."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
