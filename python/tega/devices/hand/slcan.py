"""Read a serial CAN adapter (SLCAN) in whole pieces, and write to it without waiting.

python-can reads such an adapter byte by byte, with three system calls for each, and waits another millisecond when it
is asked whether there is more: a hand that reports every 3 ms kept a third of a core busy, and with it the
interpreter. It also blocks until the adapter has taken each frame, without a limit if the adapter hangs. Only that
differs here; the lines have python-can's meaning in both directions.
"""

from __future__ import annotations

import os
import re
import select
import time
from collections.abc import Iterable
from functools import cache
from typing import Any

from tega.runtime.lifecycle import require

_PIECE_BYTES = 4096
_LINE = re.compile(rb"[^\r\a]*[\r\a]")  # an answer, a refusal
_LONGEST_BYTES = 64  # twice a frame's; what goes on for longer without an end is noise
_DONE = frozenset({b"\r", b"z\r", b"Z\r"})  # what it says to every frame that it was given


@cache
def slcan_bus() -> Any:
    """Return a subclass of python-can's slcan bus, or that bus itself where a port cannot be waited for."""
    base: Any = require("can.interfaces.slcan", driver="slcan", extra="lab").slcanBus
    error_check: Any = require("can.exceptions", driver="slcan", extra="lab").error_check
    if os.name != "posix":
        return base

    class SlcanBus(base):  # type: ignore[misc]  # python-can is imported when it is needed
        _kept: list[str] | None = None

        def send_together(self, messages: Iterable[Any], timeout: float) -> None:
            """Send messages in one piece, so that neither end is woken for each; raises what ``send`` does."""
            kept: list[str] = []
            self._kept = kept
            try:
                for message in messages:
                    self.send(message, timeout=timeout)
            finally:
                self._kept = None
            self._write(self.LINE_TERMINATOR.decode().join(kept))

        def _read(self, timeout: float | None) -> str | None:
            """Return the next line, or ``None`` when none is complete in time."""
            buffer: bytearray = self._buffer
            until_s = None if timeout is None else time.monotonic() + timeout
            while True:
                while (line := _LINE.match(buffer)) is not None:
                    answer = line[0]
                    del buffer[: len(answer)]
                    if answer not in _DONE:
                        return answer.decode()
                if len(buffer) > _LONGEST_BYTES:
                    n_bytes = len(buffer)
                    buffer.clear()
                    raise ValueError(f"{n_bytes} bytes came without the end of a line")
                left_s = None if until_s is None else max(0.0, until_s - time.monotonic())
                port = self.serialPortOrig.fileno()
                if not select.select([port], [], [], left_s)[0]:
                    return None
                piece = os.read(port, _PIECE_BYTES)
                if not piece:
                    raise OSError("the serial adapter is gone")
                buffer += piece

        def _write(self, string: str) -> None:
            """Hand a line to the system; wait for the part that it does not take at once."""
            if self._kept is not None:
                self._kept.append(string)
                return
            data = string.encode() + self.LINE_TERMINATOR
            port = self.serialPortOrig
            with error_check("Could not write to serial device"):
                try:
                    n_taken = os.write(port.fileno(), data)
                except BlockingIOError:
                    n_taken = 0
                if n_taken < len(data):
                    port.write(data[n_taken:])

    return SlcanBus
