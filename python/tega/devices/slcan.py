"""A serial CAN adapter (SLCAN), read in whole pieces.

python-can reads such an adapter byte by byte, with three system calls for each, and waits a millisecond longer when it
is asked whether there is more: a hand that reports every 3 ms kept a third of a core busy, and with it the interpreter.
Here only the reading differs; what the lines mean, and all that is sent, is python-can's.
"""

from __future__ import annotations

import os
import select
import time
from functools import cache
from typing import Any

from tega.devices.lifecycle import require

__all__ = ["slcan_bus"]

_PIECE_BYTES = 4096
_ENDS = (b"\r", b"\a")  # of an answer, of a refusal


@cache
def slcan_bus() -> Any:
    """Return the class of such a bus, a subclass of python-can's; python-can's own where a port cannot be waited for.

    Raises:
        MissingExtraError: python-can is not installed.
    """
    base: Any = require("can.interfaces.slcan", driver="slcan", extra="lab").slcanBus
    if os.name != "posix":
        return base

    class SlcanBus(base):  # type: ignore[misc]  # python-can is imported when it is needed
        def _read(self, timeout: float | None) -> str | None:
            """Return the next line, or ``None`` when none is complete in time.

            Raises:
                OSError: The adapter is gone.
            """
            buffer: bytearray = self._buffer
            until_s = None if timeout is None else time.monotonic() + timeout
            while (end := min((at for at in map(buffer.find, _ENDS) if at >= 0), default=-1)) < 0:
                left_s = None if until_s is None else max(0.0, until_s - time.monotonic())
                port = self.serialPortOrig.fileno()
                if not select.select([port], [], [], left_s)[0]:
                    return None
                piece = os.read(port, _PIECE_BYTES)
                if not piece:
                    raise OSError("the serial adapter is gone")
                buffer += piece
            line = buffer[: end + 1].decode()
            del buffer[: end + 1]
            return line

    return SlcanBus
