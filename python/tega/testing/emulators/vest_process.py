"""What the emulated vests share: what their motors do, and the pipe through which a test talks to them.

This runs in the emulator's process and knows nothing of TEGA's packets. A line is the name of a fault, which ends
every other one, ``clear`` for none, or ``look``, answered by everything that was seen.
"""

from __future__ import annotations

import asyncio
import sys
import time
from typing import Any, ClassVar, Protocol

from tega.testing.emulators.pipe import obey, tell

__all__ = ["Motors", "Vest", "serve"]

_KEPT = 5000


class Motors:
    """Forty motors, 0 to 100, in the wearer's order, with everything they have done."""

    def __init__(self) -> None:
        self.now = [0] * 40
        self.history: list[tuple[float, list[int]]] = [(time.monotonic(), self.now)]

    def set(self, values: list[int]) -> None:
        """Drive them; a change is kept with its time on the machine's monotonic clock."""
        if values != self.now and len(self.history) < _KEPT:
            self.history.append((time.monotonic(), values))
        self.now = values


class Vest(Protocol):
    """An emulated vest."""

    motors: Motors
    errors: list[str]
    received: int
    connections: int
    faults: ClassVar[tuple[str, ...]]

    async def start(self) -> dict[str, Any]:
        """Begin to listen; return what a client has to know to connect."""
        ...

    async def fault(self, name: str) -> None:
        """Switch a fault on, and every other one off; ``""`` for none."""
        ...


async def serve(vest: Vest) -> None:
    """Run an emulator until its standard input ends."""
    reader = asyncio.StreamReader()
    await asyncio.get_running_loop().connect_read_pipe(
        lambda: asyncio.StreamReaderProtocol(reader), sys.stdin
    )

    def act(words: list[str]) -> dict[str, Any]:
        if " ".join(words) not in known:
            raise ValueError(f"there are {', '.join(known)}")
        return _seen(vest) if words == ["look"] else {}

    known = (*vest.faults, "clear", "look")

    tell(await vest.start())
    while line := (await reader.readline()).decode("ascii", "replace"):
        if (name := line.strip()) in vest.faults or name == "clear":
            await vest.fault("" if name == "clear" else name)
        obey(line, act)


def _seen(vest: Vest) -> dict[str, Any]:
    return {
        "motors": vest.motors.now,
        "history": vest.motors.history,
        "errors": vest.errors,
        "received": vest.received,
        "connections": vest.connections,
        "modules": sorted(m for m in sys.modules if m.startswith("tega")),
    }
