"""An OpenBCI Cyton behind its dongle: ``python -m tega_emulators.cyton``.

33 bytes a packet: 0xA0, a counter, eight signed 24-bit counts with the most significant byte first, six auxiliary
bytes, 0xC0. Text answers end in ``$$$``; none is given while it streams. A step of the signal is 100 counts.
"""

from __future__ import annotations

import random
from typing import Any

from tega_emulators.faults import Signal
from tega_emulators.serial_board import EmulatedBoard, run_board

__all__ = ["CytonBoard", "main"]

_STEP_COUNTS = 100
_TOP = 2**23 - 1
_OFF, _ON = b"12345678", b"!@#$%^&*"
# How many bytes follow the first of a command.
_ARGUMENTS = {b"x": 8, b"z": 4, b"~": 1, b"/": 1, b"`": 1}
_FAILURE = b"Failure: Communications timeout - Device failed to poll Host$$$"


class CytonBoard(EmulatedBoard):
    """A board and its dongle.

    Firmware before 3 confirms no setting. With ``board_off`` only the dongle has power; ``streaming`` is
    whether a program that crashed has left it streaming. ``daisy`` is of a Daisy on the board: ``obeys`` is
    in the banner and taken off by ``c``, ``deaf`` is in the banner and stays, ``hidden`` is in no banner and
    stays; ``""`` for none. Its inputs are open, 11 mV off. ``shifted`` is the share of packets to which a
    radio of another version adds a second header byte, 0x41.
    """

    baud = 115_200
    rate_hz = 250.0

    def __init__(
        self,
        signal: Signal,
        *,
        firmware: str = "v3.1.2",
        board_off: bool = False,
        streaming: bool = False,
        daisy: str = "",
        shifted: float = 0.0,
    ) -> None:
        self._signal, self._firmware, self._board_off = signal, firmware, board_off
        self._daisy, self._daisy_on, self._shifted = daisy, bool(daisy), shifted
        self._rng = random.Random(1)
        self._left_streaming = streaming
        self._n, self._typed, self._on = 0, b"", [True] * 8

    def power_on(self) -> bytes:
        """Begin at sample 0; after the first time, stopped."""
        self._n, self._typed, self._on = 0, b"", [True] * 8
        self.streaming, self._left_streaming = self._left_streaming, False
        return b""

    def packet(self) -> bytes:
        """Return the next packet; a channel that is switched off measures nothing."""
        body = b""
        for on, steps in zip(self._on, self._signal.steps(self._n, 8), strict=True):
            counts = 0 if not on else _TOP if steps is None else steps * _STEP_COUNTS
            body += counts.to_bytes(3, "big", signed=True)
        # The accelerometer has a new reading at 25 Hz: 1 g on its third axis.
        aux = bytes([0, 0, 0, 0, 0x1F, 0x40]) if self._n % 10 == 0 else bytes(6)
        counter = self._n % 256
        if self._daisy_on and counter % 2 == 0:
            open_inputs = (round(self._rng.gauss(500_000, 50)) for _ in range(8))
            body = b"".join(counts.to_bytes(3, "big", signed=True) for counts in open_inputs)
        self._n += 1
        packet = bytes([0xA0, counter]) + body + aux + b"\xc0"
        return bytes([0xA0, 0x41]) + packet[1:31] + b"\xc0" if self._rng.random() < self._shifted else packet

    def receive(self, data: bytes) -> bytes:
        """Obey commands as soon as they are whole."""
        if self._board_off:
            return _FAILURE
        self._typed += data
        answer = b""
        while self._typed:
            first = self._typed[:1]
            n = 1 + _ARGUMENTS.get(first, 0)
            if len(self._typed) < n:
                break
            command, self._typed = self._typed[:n], self._typed[n:]
            text = self._obey(command)
            answer += b"" if self.streaming else text
        return answer

    def _obey(self, command: bytes) -> bytes:
        first, answer = command[:1], b""
        if first == b"b":
            self.streaming, self._n = True, 0
        elif first == b"s":
            self.streaming = False
        elif first == b"v":
            self.streaming, self._on, self._daisy_on = False, [True] * 8, bool(self._daisy)
            answer = self._banner()
        elif first == b"c":
            answer = self._take_daisy_off()
        elif first == b"V":
            answer = self._firmware.encode() + b"$$$"
        elif first == b"d":
            self._on = [True] * 8
            answer = b"updating channel settings to default\r\n$$$"
        elif first in _OFF:
            self._on[_OFF.index(first)] = False
        elif first in _ON:
            self._on[_ON.index(first)] = True
        elif not self._firmware.startswith(("v1", "v2")):
            answer = self._confirm(command)
        return answer

    def _take_daisy_off(self) -> bytes:
        """Take the Daisy off, where there is one and it obeys."""
        if self._daisy in {"deaf", "hidden"}:
            return b""
        was_on, self._daisy_on = self._daisy_on, False
        return b"daisy removed$$$" if was_on else b"no daisy to remove!$$$"

    def _confirm(self, command: bytes) -> bytes:
        """Carry out a setting and confirm it."""
        if command[:1] == b"~":
            # Over the radio the board keeps to 250 Hz, whatever it is asked for.
            return b"Success: Sample rate is 250Hz$$$"
        channel, power, gain = command[1:2], command[2:3], command[3:4]
        if command[:1] != b"x":
            return b""
        if channel not in _OFF or power not in b"01" or gain not in b"0123456" or command[8:] != b"X":
            return b"Failure: Err: too many chars$$$"
        self._on[_OFF.index(channel)] = power == b"0"
        return b"Success: Channel set for " + channel + b"$$$"

    def _banner(self) -> bytes:
        daisy = "On Daisy ADS1299 Device ID: 0x3E\r\n" if self._daisy in {"obeys", "deaf"} else ""
        return (
            f"OpenBCI V3 8-16 channel\r\nOn Board ADS1299 Device ID: 0x3E\r\n{daisy}LIS3DH Device ID: 0x33\r\n"
            f"Firmware: {self._firmware}\r\n$$$"
        ).encode()


def main() -> None:
    """Run the board."""
    options: dict[str, dict[str, Any]] = {
        "--firmware": {"default": "v3.1.2"},
        "--board-off": {"action": "store_true", "help": "only the dongle answers"},
        "--streaming": {"action": "store_true", "help": "left streaming by a crashed program"},
        "--daisy": {"choices": ("obeys", "deaf", "hidden"), "default": "", "help": "it has 16 channels"},
        "--shifted": {"type": float, "default": 0.0, "help": "share of packets with a second header byte"},
    }
    run_board(__doc__, CytonBoard, options, rate_hz=CytonBoard.rate_hz)


if __name__ == "__main__":
    main()
