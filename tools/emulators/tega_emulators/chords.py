"""A board with Chords firmware: ``python -m tega_emulators.chords``.

0xC7 0x7C, a counter, one unsigned 16-bit number per channel with the high byte first, 0x01. It says its name to
``WHORU``, and starts and stops to ``START`` and ``STOP``. Two generations of sketches are in use, which accept commands
differently (upsidedownlabs/Chords-Arduino-Firmware, ``UNO-R4/UNO-R4.ino`` of October 2024 and
``NPG-LITE-Serial/NPG-LITE-Serial.ino`` of 2026); :class:`ChordsBoard` says how.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Final

from tega_emulators.faults import Signal
from tega_emulators.serial_board import EmulatedBoard, run_board

__all__ = ["GENERATIONS", "ChordsBoard", "main"]

GENERATIONS: Final = (2024, 2026)
"""Years of the sketches."""

# How long the sketches of 2024 wait for another byte before they look at what came: Arduino's readString().
_SILENCE_S: Final = 1.0
# The sketches of 2026 take a line, or what came before so long a silence.
_LINE_SILENCE_S: Final = 0.1
# They blink before they go on.
_START_S: Final = 0.4
_STOP_S: Final = 1.0


class ChordsBoard(EmulatedBoard):
    """Waits for commands, then sends packets.

    A board of 2024 takes all that came until a second of silence for one command, does not answer one that it
    does not know, and counts from 0. One of 2026 takes lines, answers ``UNKNOWN COMMAND``, counts from 1, and
    receives nothing while it blinks: 0.4 s at ``START``, 1 s at ``STOP``. On both, a byte that arrives stops
    the packets.

    ``name`` is its answer to ``WHORU``, ``rate_hz`` packets per second, ``bits`` those of its converter,
    ``n_channels`` the numbers in a packet, ``generation`` one of :data:`GENERATIONS`.
    """

    def __init__(
        self,
        signal: Signal,
        *,
        name: str,
        rate_hz: float,
        bits: int,
        n_channels: int,
        baud: int,
        generation: int = 2026,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self.rate_hz, self.baud = rate_hz, baud
        self._signal, self._name, self._n_channels = signal, name, n_channels
        self._middle, self._top = 2 ** (bits - 1), 2**bits - 1
        self._lines, self._now_s = generation > GENERATIONS[0], now_s
        self.power_on()

    def power_on(self) -> bytes:
        """Begin stopped, at sample 0."""
        self._n, self._typed, self.streaming = 0, b"", False
        self._received_s = self._busy_until_s = 0.0
        self._starts = False
        return b""

    def receive(self, data: bytes) -> bytes:
        """Keep what came for :meth:`go_on`; it stops the packets, whatever it is."""
        self._typed += data
        self._received_s = self._now_s()
        if self.streaming:
            self._stop()
        return b""

    def go_on(self) -> bytes:
        """Carry out what is due by now, and return the answers."""
        answer = b""
        while self._now_s() >= self._busy_until_s:
            if self._starts:
                self._starts, self.streaming = False, True
            command = self._command()
            if command is None:
                break
            answer += self._obey(command)
        return answer

    def _command(self) -> str | None:
        """Return the next command that the sketch's way of reading gives it."""
        silent_s = self._now_s() - self._received_s
        if self._lines and b"\n" in self._typed:
            taken, _, self._typed = self._typed.partition(b"\n")
        elif self._typed and silent_s >= (_LINE_SILENCE_S if self._lines else _SILENCE_S):
            taken, self._typed = self._typed, b""
        else:
            return None
        text = taken.decode("latin-1").strip()
        return text.upper() if self._lines else text

    def _obey(self, command: str) -> bytes:
        match command:
            case "WHORU":
                return self._name.encode() + b"\r\n"
            case "START":
                self._starts = True
                self._busy_until_s = self._now_s() + (_START_S if self._lines else 0.0)
            case "STOP":
                self._stop()
            case "STATUS":
                words = ("STOPPED", "RUNNING") if self._lines else ("STOP", "START")
                return words[self.streaming].encode() + b"\r\n"
            case _:
                return b"UNKNOWN COMMAND\r\n" if self._lines else b""
        return b""

    def _stop(self) -> None:
        self.streaming = self._starts = False
        if self._lines:
            self._busy_until_s = self._now_s() + _STOP_S

    def packet(self) -> bytes:
        """Return the next packet."""
        values = [
            self._top if v is None else min(self._top, self._middle + v)
            for v in self._signal.steps(self._n, self._n_channels)
        ]
        counter = (self._n + self._lines) % 256
        self._n += 1
        return bytes([0xC7, 0x7C, counter]) + b"".join(v.to_bytes(2, "big") for v in values) + b"\x01"


def main() -> None:
    """Run the board."""
    options: dict[str, dict[str, Any]] = {
        "--name": {"default": "NPG-LITE"},
        "--rate": {"type": float, "default": 500.0, "dest": "rate_hz"},
        "--bits": {"type": int, "default": 12},
        "--channels": {"type": int, "default": 3, "dest": "n_channels"},
        "--baud": {"type": int, "default": 230_400},
        "--generation": {"type": int, "choices": GENERATIONS, "default": GENERATIONS[-1]},
    }
    run_board(__doc__, ChordsBoard, options)


if __name__ == "__main__":
    main()
