"""A board that prints its samples, one line a sample: ``python -m tega_emulators.ascii_board``.

A line is ``511,512,513`` and CR LF, counts of a 10-bit converter about its middle.
"""

from __future__ import annotations

from typing import Any

from tega_emulators.faults import Signal
from tega_emulators.serial_board import EmulatedBoard, run_board

__all__ = ["AsciiBoard", "main"]


class AsciiBoard(EmulatedBoard):
    """Prints numbers from the moment it has power, ``rate_hz`` lines per second, after a line ``banner``.

    With ``stamp`` a line begins with the milliseconds since it started.
    """

    def __init__(
        self, signal: Signal, *, rate_hz: float, n_channels: int, baud: int, stamp: bool, banner: str
    ) -> None:
        self.rate_hz, self.baud = rate_hz, baud
        self._signal, self._n_channels, self._stamp, self._banner = signal, n_channels, stamp, banner
        self._n = 0

    def power_on(self) -> bytes:
        """Begin at sample 0, with the banner."""
        self._n = 0
        return f"{self._banner}\r\n".encode() if self._banner else b""

    def packet(self) -> bytes:
        """Return the next line."""
        row = [
            1023 if v is None else min(1023, 512 + v) for v in self._signal.steps(self._n, self._n_channels)
        ]
        fields = [round(1000 * self._n / self.rate_hz)] * self._stamp + row
        self._n += 1
        return ",".join(map(str, fields)).encode() + b"\r\n"


def main() -> None:
    """Run the board."""
    options: dict[str, dict[str, Any]] = {
        "--rate": {"type": float, "default": 500.0, "dest": "rate_hz", "help": "lines per second"},
        "--channels": {"type": int, "default": 3, "dest": "n_channels"},
        "--baud": {"type": int, "default": 115_200},
        "--stamp": {"action": "store_true", "help": "put milliseconds first on a line"},
        "--banner": {"default": "", "help": "what the board says when it starts"},
    }
    run_board(__doc__, AsciiBoard, options)


if __name__ == "__main__":
    main()
