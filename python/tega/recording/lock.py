"""Mark a file as being written, so that no other program takes it for one that was left behind."""

from __future__ import annotations

import sys
from typing import BinaryIO


def lock(file: BinaryIO) -> bool:
    """Mark an open file as being written, for as long as it is open; return whether nobody else has.

    The mark dies with the process. Where the system has no such marks the answer is yes.
    """
    if sys.platform == "win32":
        return True
    import fcntl

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
