"""The pipe between an emulator's process and who started it; this end knows nothing of the device.

The first line on standard output says where the emulator can be reached. Each line of standard input is a command,
answered by one line: a JSON object, with ``error`` in it where the command was not understood. The end of the input
ends the program, so that an emulator does not outlive who started it.
"""

from __future__ import annotations

import asyncio
import json
import sys
from collections.abc import AsyncIterator, Callable, Mapping
from typing import Any

__all__ = ["notify", "obey", "typed"]


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
