"""A board with Chords firmware: ``python -m tega.testing.emulators.chords``.

0xC7 0x7C, a counter, one unsigned 16-bit number per channel with the high byte first, 0x01. It says its name to
``WHORU``, and starts and stops to ``START`` and ``STOP``, each ended by a newline.
"""

from __future__ import annotations

import argparse
import random

from tega.testing.emulators.faults import Faults, Signal
from tega.testing.emulators.serial_board import Board, add_options, serve

__all__ = ["ChordsBoard", "main"]


class ChordsBoard(Board):
    """Waits for commands, then sends packets.

    Args:
        signal: What it measures.
        name: What it says to ``WHORU``.
        rate_hz: Packets per second.
        bits: Of its converter.
        n_channels: Numbers in a packet.
        baud: Its speed.
    """

    def __init__(
        self, signal: Signal, *, name: str, rate_hz: float, bits: int, n_channels: int, baud: int
    ) -> None:
        self.rate_hz, self.baud = rate_hz, baud
        self._signal, self._name, self._n_channels = signal, name, n_channels
        self._middle, self._top = 2 ** (bits - 1), 2**bits - 1
        self._n, self._typed = 0, b""

    def power_on(self) -> bytes:
        """Begin stopped, at sample 0."""
        self._n, self._typed, self.streaming = 0, b"", False
        return b""

    def hear(self, data: bytes) -> bytes:
        """Obey whole lines."""
        *lines, self._typed = (self._typed + data).split(b"\n")
        answer = b""
        for line in lines:
            match line.strip():
                case b"WHORU":
                    answer += self._name.encode() + b"\r\n"
                case b"START":
                    self.streaming = True
                case b"STOP":
                    self.streaming = False
                case b"STATUS":
                    answer += b"RUNNING\r\n" if self.streaming else b"STOPPED\r\n"
        return answer

    def packet(self) -> bytes:
        """Return the next packet."""
        values = [
            self._top if v is None else min(self._top, self._middle + v)
            for v in self._signal.steps(self._n, self._n_channels)
        ]
        counter = self._n % 256
        self._n += 1
        return bytes([0xC7, 0x7C, counter]) + b"".join(v.to_bytes(2, "big") for v in values) + b"\x01"


def main() -> None:
    """Run the board."""
    parser = argparse.ArgumentParser(description=__doc__)
    add_options(parser)
    parser.add_argument("--name", default="NPG-LITE")
    parser.add_argument("--rate", type=float, default=500.0)
    parser.add_argument("--bits", type=int, default=12)
    parser.add_argument("--channels", type=int, default=3)
    parser.add_argument("--baud", type=int, default=230_400)
    options = parser.parse_args()
    rng = random.Random(options.seed)
    signal = Signal(options.rate, rng, options.signal)
    board = ChordsBoard(
        signal,
        name=options.name,
        rate_hz=options.rate,
        bits=options.bits,
        n_channels=options.channels,
        baud=options.baud,
    )
    serve(board, signal, Faults(rng), options)


if __name__ == "__main__":
    main()
