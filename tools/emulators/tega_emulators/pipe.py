"""The pipe between an emulator's process and who started it; this end knows nothing of the device.

The first line on standard output says where the emulator can be reached. Each line of standard input is a command,
answered by one line: a JSON object, with ``error`` in it where the command was not understood. The end of the input
ends the program, so that an emulator does not outlive who started it.
"""

from __future__ import annotations

import asyncio
import json
import socket
import sys
from collections.abc import AsyncIterator, Callable, Iterator, Mapping, Sequence
from typing import Any

__all__ = ["HiddenPort", "notify", "obey", "obey_next", "typed"]


class HiddenPort:
    """A TCP port on this computer that can be hidden; it comes back under the same number."""

    def __init__(self) -> None:
        self.listener: socket.socket | None = None
        self._port = 0

    def show(self) -> int:
        """Listen, at the same port as before, and return that."""
        if self.listener is None:
            self.listener = socket.create_server(("127.0.0.1", self._port), backlog=4)
            self._port = self.listener.getsockname()[1]
        return self._port

    def hide(self) -> None:
        """Listen no more."""
        if self.listener is not None:
            self.listener.close()
        self.listener = None

    def newcomers(self, ready: Sequence[object]) -> Iterator[socket.socket]:
        """Yield who has connected, where the listener is among what is ready."""
        if self.listener is not None and self.listener in ready:
            client, _ = self.listener.accept()
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            yield client


def notify(text: Mapping[str, Any]) -> None:
    """Print something for who started this."""
    sys.stdout.write(json.dumps(text) + "\n")
    sys.stdout.flush()


async def typed() -> AsyncIterator[str]:
    """Yield the lines of standard input until it ends."""
    reader = asyncio.StreamReader()
    await asyncio.get_running_loop().connect_read_pipe(
        lambda: asyncio.StreamReaderProtocol(reader), sys.stdin
    )
    while line := (await reader.readline()).decode("ascii", "replace"):
        yield line


def obey(line: str, act: Callable[[list[str]], Mapping[str, Any] | None]) -> None:
    """Carry out a line and answer it; one that cannot be carried out ends nothing.

    ``act``, given its words, returns the answer; it raises ValueError, KeyError or IndexError on nonsense.
    """
    try:
        text = act(line.split())
    except (ValueError, KeyError, IndexError) as error:
        text = {"error": f"{line.strip()!r} means nothing here: {error}"}
    notify(text or {})


def obey_next(act: Callable[[list[str]], Mapping[str, Any] | None]) -> bool:
    """Carry out the line of standard input that has come, as :func:`obey` does; return False where it has ended."""
    if line := sys.stdin.readline():
        obey(line, act)
    return bool(line)
