"""Send Python objects through a pipe between a run and a process of its own, pictures and samples as they lie.

The recorder is such a process, the hand's loop, each scene camera, and what :mod:`tega.runtime.call_beside` calls.

Both ends are this version of TEGA, started by one person: nothing from outside comes through such a pipe.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import struct
import sys
import threading
from io import BufferedReader, BufferedWriter, FileIO
from typing import Any

_COUNT = struct.Struct("<I")
_SIZE = struct.Struct("<Q")
_PIPE_BYTES = 1 << 20
_PROTOCOL = 5


class AnswerPipe:
    """Sends answers to the run, from any thread."""

    def __init__(self, pipe: BufferedWriter) -> None:
        self._pipe = pipe
        self._lock = threading.Lock()

    def say(self, *subject: Any) -> None:
        """Send one; nothing happens where the run was killed."""
        with self._lock, contextlib.suppress(OSError):
            send_object(self._pipe, subject)


def program_pipes() -> tuple[BufferedReader, AnswerPipe]:
    """Return, in a program that the run has started, the pipes for its requests and the answers.

    Standard output is redirected to the terminal, so that output of libraries does not mix with answers.
    """
    pipe = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    return os.fdopen(os.dup(sys.stdin.fileno()), "rb"), AnswerPipe(pipe)


def widen_pipe(pipe: BufferedWriter) -> None:
    """Let a pipe hold a mebibyte where the system allows it, so that a picture goes through in one piece."""
    if sys.platform == "linux":
        import fcntl

        with contextlib.suppress(OSError):  # it goes as it is
            fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, _PIPE_BYTES)


def send_object(pipe: BufferedWriter, content: Any) -> None:
    """Write an object, arrays without a copy; ``OSError`` where the reader is gone."""
    arrays: list[pickle.PickleBuffer] = []
    head = pickle.dumps(content, _PROTOCOL, buffer_callback=arrays.append)
    parts = [memoryview(head), *(array.raw() for array in arrays)]
    pipe.write(_COUNT.pack(len(parts)) + b"".join(_SIZE.pack(part.nbytes) for part in parts))
    for part in parts:
        pipe.write(part)
    pipe.flush()


def receive_object(pipe: BufferedReader | FileIO) -> Any:
    """Read an object; ``EOFError`` where the other end is closed."""
    (n_parts,) = _COUNT.unpack(_exactly(pipe, _COUNT.size))
    sizes = [size for (size,) in _SIZE.iter_unpack(_exactly(pipe, n_parts * _SIZE.size))]
    head, *arrays = (_exactly(pipe, size) for size in sizes)
    return pickle.loads(head, buffers=arrays)


def _exactly(pipe: BufferedReader | FileIO, n_bytes: int) -> bytearray:
    data = bytearray(n_bytes)
    view, n_read = memoryview(data), 0
    while n_read < n_bytes:
        n = pipe.readinto(view[n_read:])
        if not n:
            raise EOFError
        n_read += n
    return data
