"""Write a file whole or not at all, or add to it, and never change another file than the one named.

A folder of unknown origin can hold a link in the place of any file that a program creates beside its own; writing
through it would change the link's target. A file that is written whole is a new file, which then replaces the old
file or link; a file that is appended to is opened without following links. A file that is being written can be marked.
"""

from __future__ import annotations

import os
import stat
import sys
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, BinaryIO, Final

from tega.errors import RecordingError

# Windows has neither such links nor such pipes, and Linux needs no flag for bytes.
_APPENDS: Final = os.O_RDWR | os.O_APPEND | os.O_CREAT
_GUARDED: Final[int] = sum(
    getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY", "O_CLOEXEC")
)

LOCK_SUFFIX: Final = ".lock"

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
        with beside.open("xb") as file:  # made anew, or not at all: never through a link
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
