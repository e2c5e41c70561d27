"""A HoloLens 2 that runs the hl2ss app: ``python -m tega_emulators.hololens``.

Only its spatial input, written from the fact sheet's table of bytes: a client receives packets of 1948 bytes,
60 a second, without asking. Device time counts 100 ns from when the app started. A hand that is lost keeps its last
bytes; only its bit is cleared. Nothing it does is a real headset's; its hand trembles by 0.2 mm. It obeys::

    at X Y Z          place of the right wrist, metres, y up, -z forward; the left one stands 0.4 m beside it
    turn QX QY QZ QW  its turn
    wave A HZ         it swings forward and back by A metres, so often a second
    lose, find        the right hand's bit
    restart DX DY DZ  the app ends and starts again with its origin elsewhere, and its clock at 0
    hang-up           connections end; new ones are taken
    hide, show        nobody listens any more; connections end
    stall S           sends nothing for so long, then all of it at once
    late MS           packets arrive so late
    jump DX DY DZ     the wrist is elsewhere for one packet
    cut               half a packet, then the connection ends
    freeze, ...       what FAULTS says; clear ends them
"""

from __future__ import annotations

import argparse
import contextlib
import math
import random
import select
import socket
import struct
import sys
import time
from collections import deque
from typing import Any, Final

from tega_emulators.pipe import HiddenPort, notify, obey_next

__all__ = ["FAULTS", "Headset", "main"]

FAULTS: Final = {
    "freeze": "sends nothing any more, and keeps the connection",
    "same": "the hand's pose is not updated, packets and their times go on",
    "guess": "every joint is only approximate",
    "odd-size": "packets say that they are one byte longer",
    "nan": "a coordinate of the wrist is not a number",
    "zero-turn": "the wrist's quaternion is zero",
    "old-time": "packets keep the time of the first of them",
    "no-hands": "only the head is tracked",
}

_HEAD, _RIGHT = 1, 8
_LEFT: Final = 4
_JOINTS: Final = 26
_WRIST: Final = 1
_TREMOR_M: Final = 2e-4
_PAYLOAD: Final = 1936

Triple = tuple[float, float, float]
Joint = tuple[tuple[float, float, float, float], Triple]


class Headset:
    """What a headset sees, and its packets; ``seed`` is of the tremor."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self._displayed: bytes = b""
        self.at: Triple = (0.2, -0.3, -0.4)
        self.turn = (0.0, 0.0, 0.0, 1.0)
        self.origin: Triple = (0.0, 0.0, 0.0)
        self.wave: tuple[float, float] = (0.0, 0.0)
        self.jump: Triple = (0.0, 0.0, 0.0)
        self.seen = True
        self.faults: set[str] = set()

    def packet(self, device_100ns: int) -> bytes:
        """Return the packet of a time."""
        bits = _HEAD
        if "no-hands" not in self.faults:
            bits |= _LEFT | (_RIGHT if self.seen else 0)
        if self.seen and ("same" not in self.faults or not self._displayed):
            self._displayed = self._hand(self._wrist(device_100ns / 1e7))
        left = self._hand(((0.0, 0.0, 0.0, 1.0), (-0.2, -0.3, -0.4)))
        head = struct.pack("<9f", 0, 0, 0, 0, 0, -1, 0, 1, 0) + bytes(24)
        size = _PAYLOAD + ("odd-size" in self.faults)
        return struct.pack("<QII", device_100ns, size, bits) + head + left + self._displayed

    def _wrist(self, t_s: float) -> Joint:
        size_m, often_hz = self.wave
        forward_m = size_m * math.sin(2 * math.pi * often_hz * t_s)
        x, y, z = (
            a - o + j + self._random.gauss(0, _TREMOR_M)
            for a, o, j in zip(self.at, self.origin, self.jump, strict=True)
        )
        self.jump = (0.0, 0.0, 0.0)
        turn = (0.0, 0.0, 0.0, 0.0) if "zero-turn" in self.faults else self.turn
        return turn, (math.nan if "nan" in self.faults else x, y, z - forward_m)

    def _hand(self, wrist: Joint) -> bytes:
        """Return all joints; those that are not the wrist make fists and wave about."""
        hand, accuracy = b"", int("guess" in self.faults)
        for number in range(_JOINTS):
            turn, place = wrist
            if number != _WRIST:
                place = (self._random.random(), self._random.random(), self._random.random())
                turn = (1.0, 0.0, 0.0, 0.0)
            hand += struct.pack("<4f3ffi", *turn, *place, 0.01, accuracy)
        return hand


class _HeadsetEmulator:
    def __init__(self, headset: Headset, rate_hz: float) -> None:
        self._headset, self._step_s = headset, 1 / rate_hz
        self._port = HiddenPort()
        self._clients: list[socket.socket] = []
        self._began_s = self._next_s = time.monotonic()
        self._first_100ns: int | None = None
        self._stalled_until_s = 0.0
        self._late_s = 0.0
        self._waiting: deque[tuple[float, bytes]] = deque()

    def run(self) -> None:
        notify({"host": "127.0.0.1", "port": self._port.show()})
        while True:
            listeners = [self._port.listener] if self._port.listener else []
            ready, _, _ = select.select([sys.stdin, *listeners], [], [], 0.002)
            if sys.stdin in ready and not obey_next(self._act):
                return
            self._clients.extend(self._port.newcomers(ready))
            self._go_on(time.monotonic())

    def _go_on(self, now_s: float) -> None:
        while now_s >= self._next_s:
            self._next_s += self._step_s
            if "freeze" in self._headset.faults:
                continue
            device_100ns = round((self._next_s - self._began_s) * 1e7)
            if "old-time" in self._headset.faults:
                self._first_100ns = self._first_100ns or device_100ns
                device_100ns = self._first_100ns
            self._waiting.append((self._next_s + self._late_s, self._headset.packet(device_100ns)))
        if now_s < self._stalled_until_s:
            return
        while self._waiting and self._waiting[0][0] <= now_s + self._step_s:
            self._send(self._waiting.popleft()[1])

    def _send(self, data: bytes) -> None:
        for client in list(self._clients):
            try:
                client.sendall(data)
            except OSError:
                client.close()
                self._clients.remove(client)

    def _hang_up(self) -> None:
        for client in self._clients:
            client.close()
        self._clients.clear()
        self._waiting.clear()

    def _act(self, words: list[str]) -> dict[str, Any] | None:
        headset, verb = self._headset, words[0]
        numbers = [float(word) for word in words[1:]]
        if verb == "at":
            headset.at = (numbers[0], numbers[1], numbers[2])
        elif verb == "turn":
            headset.turn = (numbers[0], numbers[1], numbers[2], numbers[3])
        elif verb == "wave":
            headset.wave = (numbers[0], numbers[1])
        elif verb == "jump":
            headset.jump = (numbers[0], numbers[1], numbers[2])
        elif verb in {"lose", "find"}:
            headset.seen = verb == "find"
        elif verb == "stall":
            self._stalled_until_s = time.monotonic() + numbers[0]
        elif verb == "late":
            self._late_s = numbers[0] / 1e3
        elif verb == "clear":
            headset.faults.clear()
            self._first_100ns = None
        elif verb in FAULTS:
            headset.faults.add(verb)
        else:
            return self._connection(verb, numbers)
        return None

    def _connection(self, verb: str, numbers: list[float]) -> dict[str, Any]:
        if verb == "cut":
            self._send(self._headset.packet(1)[:974])
        elif verb == "restart":
            self._headset.origin = (numbers[0], numbers[1], numbers[2])
            self._began_s = self._next_s = time.monotonic()
        elif verb == "hide":
            self._port.hide()
        elif verb == "show":
            return {"port": self._port.show()}
        elif verb == "look":
            return {"clients": len(self._clients)}
        elif verb != "hang-up":
            raise KeyError(verb)
        self._hang_up()
        return {}


def main() -> None:
    """Run it until the standard input closes."""
    parser = argparse.ArgumentParser(description="An emulated HoloLens 2 with the hl2ss app.")
    parser.add_argument("--rate-hz", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    with contextlib.suppress(KeyboardInterrupt):
        _HeadsetEmulator(Headset(options.seed), options.rate_hz).run()


if __name__ == "__main__":
    main()
