"""A Muscle SpikerShield with the sketch for six channels: ``python -m tega_emulators.spiker``.

Two bytes a channel, the upper three bits first and the lower seven after them; only the first byte of a frame has its
uppermost bit set. It starts with ``StartUp!`` and one channel, and takes ``c:3;`` and a line break for three; it reads
``s:`` and all else and does not mind. ``--deaf`` is a board whose sketch takes no command.
"""

from __future__ import annotations

import re
from typing import Any

from tega_emulators.faults import Signal
from tega_emulators.serial_board import EmulatedBoard, run_board

__all__ = ["SpikerBoard", "main"]

_BASE_HZ = 16e6 / 8 / 199


class SpikerBoard(EmulatedBoard):
    """Sends frames from the moment it has power; ``n_channels`` until a command sets another number.

    A ``deaf`` one takes no command.
    """

    def __init__(self, signal: Signal, *, n_channels: int = 1, deaf: bool = False) -> None:
        self.baud = 230_400
        self._signal, self._first, self._deaf = signal, n_channels, deaf
        self.power_on()

    def power_on(self) -> bytes:
        """Begin at sample 0, with the banner and the first number of channels."""
        self._n, self._typed, self._n_channels = 0, b"", self._first
        self.rate_hz = _BASE_HZ / self._n_channels
        return b"StartUp!\r\n"

    def receive(self, data: bytes) -> bytes:
        """Carry out the lines that are whole; it answers none."""
        *lines, self._typed = (self._typed + data).split(b"\n")
        for line in lines:
            for command in line.split(b";"):
                if not self._deaf and (match := re.search(rb"c:(\d+)", command)):
                    self._n_channels = int(match[1])
                    self.rate_hz = _BASE_HZ / self._n_channels
        return b""

    def packet(self) -> bytes:
        """Return the next frame."""
        steps = self._signal.steps(self._n, self._n_channels)
        self._n += 1
        frame = bytearray()
        for step in steps:
            value = 1023 if step is None else max(0, min(1023, 512 + step))
            frame += bytes([value >> 7, value & 0x7F])
        frame[0] |= 0x80
        return bytes(frame)


def main() -> None:
    """Run the board."""
    options: dict[str, dict[str, Any]] = {
        "--channels": {
            "type": int,
            "default": 1,
            "dest": "n_channels",
            "help": "before a command changes it",
        },
        "--deaf": {"action": "store_true", "help": "take no command"},
    }
    run_board(__doc__, SpikerBoard, options, rate_hz=_BASE_HZ / 3)


if __name__ == "__main__":
    main()
