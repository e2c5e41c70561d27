"""Write a file whole or not at all, and over no other file than the one named.

A folder that somebody else made can hold a link in the place of every file that a program would make beside its own;
written through, it would change what the link leads to. What is written here is a new file, which then takes the place
of the old file or link.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO


@contextmanager
def new_file(path: Path, *, sync: bool = False) -> Iterator[BinaryIO]:
    """Open a new file that takes a path's place when the block ends, and is gone where an error ends it.

    Args:
        path: The place; a link there is replaced, not followed.
        sync: Bring it to the disk before it takes the place, so that it outlives a loss of power.
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
    """Write a file; its folder is made if need be.

    Args:
        path: The file.
        data: Its content; text as UTF-8.
        sync: As in :func:`new_file`.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with new_file(path, sync=sync) as file:
        file.write(data.encode() if isinstance(data, str) else data)
