"""Mark a file as being written, so that no second program writes it too."""

from __future__ import annotations

import sys
import weakref
from pathlib import Path
from typing import IO, Final

from filelock import lock_descriptor

LOCK_SUFFIX: Final = ".lock"

# A lock of Windows keeps others from reading what is locked, and a recording is looked at while it grows.
_KEEPS_READERS_OUT = sys.platform == "win32"


def lock_file(file: IO[bytes], path: Path) -> bool:
    """Mark an open file as being written, for as long as it is open; the mark dies with the process.

    Where a lock would keep readers out, it is an empty file beside it that is locked, with
    :data:`LOCK_SUFFIX` behind its name; that one stays locked until ``file`` is dropped. True if no other
    process has marked it, and on a file system without locks.
    """
    marked = file
    if _KEEPS_READERS_OUT:
        marked = path.with_name(path.name + LOCK_SUFFIX).open("ab")
        weakref.finalize(file, marked.close)
    try:
        return lock_descriptor(marked.fileno(), blocking=False)
    except OSError:
        return True
