"""What the emulated vests share: what their motors do, and the pipe through which a test talks to them.

This runs in the emulator's process and knows nothing of TEGA's packets. One JSON object a line comes in,
``{"fault": "freeze"}`` (``""`` for none) or ``{"report": true}``, and one goes out for each. The end of the input ends
the program, so that an emulator does not outlive who started it.
"""

from __future__ import annotations

import asyncio
import json
import sys
import time
from typing import Any, ClassVar, Protocol

__all__ = ["Emulator", "Motors", "serve"]

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


class Emulator(Protocol):
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
        """Switch a fault on, and every other one off."""
        ...


async def serve(emulator: Emulator) -> None:
    """Run an emulator until its standard input ends."""
    reader = asyncio.StreamReader()
    await asyncio.get_running_loop().connect_read_pipe(
        lambda: asyncio.StreamReaderProtocol(reader), sys.stdin
    )
    _answer(await emulator.start())
    while line := await reader.readline():
        request = json.loads(line)
        if "fault" in request and request["fault"] not in {"", *emulator.faults}:
            _answer({"error": f"no fault {request['fault']!r}; there are {', '.join(emulator.faults)}"})
        elif "fault" in request:
            await emulator.fault(request["fault"])
            _answer({})
        else:
            _answer(
                {
                    "motors": emulator.motors.now,
                    "history": emulator.motors.history,
                    "errors": emulator.errors,
                    "received": emulator.received,
                    "connections": emulator.connections,
                    "modules": sorted(m for m in sys.modules if m.startswith("tega")),
                }
            )


def _answer(answer: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(answer) + "\n")
    sys.stdout.flush()
