"""A board on the far side of a serial port, which here is a pseudo-terminal (Linux, macOS).

The host's end is a real terminal device: it is opened, configured and read as any port is. The speed the host sets
is looked at, and at another than the board's the bytes come out wrong, as they would on a wire.
"""

from __future__ import annotations

import argparse
import os
import random
import select
import sys
import termios
import time
import tty
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from tega_emulators.faults import FAULTS, SIGNALS, Faults, Signal
from tega_emulators.pipe import notify, obey

__all__ = ["EmulatedBoard", "run_board"]

# So many packets' times are remembered, which `sent` returns.
_KEPT = 4096


class EmulatedBoard:
    """What an emulator adds to the line: its bytes.

    ``rate_hz`` are packets per second; ``baud`` is 0 for a native USB board, which does not care;
    ``streaming`` is whether it sends packets.
    """

    rate_hz: float = 250.0
    baud: int = 115_200
    streaming = True

    def packet(self) -> bytes:
        """Return the next packet, counted."""
        raise NotImplementedError

    def receive(self, data: bytes) -> bytes:  # noqa: ARG002  # a board that only talks
        """Take what the host sent and return the answer."""
        return b""

    def go_on(self) -> bytes:
        """Do what is due by now and return what it sends; called as often as the line is looked at."""
        return b""

    def power_on(self) -> bytes:
        """Start from nothing and return what the board sends of itself when it starts."""
        return b""


def run_board(
    about: str | None,
    make: Callable[..., EmulatedBoard],
    options: Mapping[str, Mapping[str, Any]],
    *,
    rate_hz: float | None = None,
) -> None:
    """Run the board of a command line until its standard input closes or has ``quit``.

    Args:
        about: What ``--help`` says.
        make: Makes the board from its signal and the values of ``options``.
        options: The board's own, by flag, as :meth:`argparse.ArgumentParser.add_argument` takes them; beside them
            are those that every serial emulator has.
        rate_hz: Rate of its signal; ``None`` where the option ``rate_hz`` says it.
    """
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--signal", choices=SIGNALS, default="ramp")
    parser.add_argument("--burst-ms", type=float, default=4.0, help="deliver at most this often; FTDI: 16")
    parser.add_argument(
        "--fault", action="append", default=[], metavar="NAME=VALUE", help=f"one of {', '.join(FAULTS)}"
    )
    own = {parser.add_argument(flag, **how).dest for flag, how in options.items()}
    given = parser.parse_args()
    rng = random.Random(given.seed)
    signal, faults = Signal(rate_hz or given.rate_hz, rng, given.signal), Faults(rng)
    for text in given.fault:
        name, _, value = text.partition("=")
        faults.set(name, float(value or 1))
    board = make(signal, **{name: value for name, value in vars(given).items() if name in own})
    line = _Line(board, signal, faults, random.Random(given.seed + 1))
    notify({"port": line.port})
    try:
        line.run(given.burst_ms / 1000)
    finally:
        line.unplug()


class _Line:
    def __init__(self, board: EmulatedBoard, signal: Signal, faults: Faults, rng: random.Random) -> None:
        self._board, self._signal, self._faults, self._rng = board, signal, faults, rng
        self.port = ""
        self._ends: tuple[int, int] | None = None
        self._vanished: list[int] = []
        self._received = b""
        self._rest = b""
        self._typed = b""
        self._sent_ns: deque[int] = deque(maxlen=_KEPT)
        self._plug()

    def _plug(self) -> None:
        ours, hosts = os.openpty()
        tty.setraw(hosts)
        os.set_blocking(ours, False)
        self._ends, self._rest, self._received = (ours, hosts), b"", b""
        self.port = os.ttyname(hosts)
        self._send(self._board.power_on())

    def unplug(self) -> None:
        """Let the port vanish; its number is kept, lest another program's port be taken for this one come back."""
        if self._ends is not None:
            ours, hosts = self._ends
            os.close(ours)
            self._vanished.append(hosts)
        self._ends = None

    def run(self, burst_s: float) -> None:
        """Send packets in time, receive from the host, and obey the standard input."""
        due, last_s = 0.0, time.monotonic()
        while True:
            watched = [sys.stdin.fileno(), *([self._ends[0]] if self._ends else [])]
            ready, _, _ = select.select(watched, [], [], burst_s)
            if self._ends and self._ends[0] in ready:
                self._receive(self._ends[0])
            if sys.stdin.fileno() in ready and not self._obey():
                return
            if not self._faults.frozen:
                self._send(self._board.go_on())
            now_s = time.monotonic()
            if now_s - last_s < burst_s:
                continue
            due += (now_s - last_s) * self._board.rate_hz * self._faults.share["slow"]
            last_s = now_s
            while due >= 1:
                due -= 1
                if self._board.streaming and not self._faults.frozen:
                    self._send(self._faults.pass_on(self._board.packet()))
                    self._sent_ns.append(time.monotonic_ns())

    def _receive(self, ours: int) -> None:
        try:
            data = os.read(ours, 4096)
        except OSError:
            return
        self._received += data
        if not self._faults.frozen:
            self._send(self._board.receive(self._over_the_wire(data)))

    def _send(self, data: bytes) -> None:
        """Write to the host; what it does not take is lost, as in an adapter whose buffer is full."""
        if self._ends is None or not data:
            return
        data = self._rest + self._over_the_wire(data)
        try:
            n = os.write(self._ends[0], data)
        except BlockingIOError:
            n = 0
        # The rest of a packet that went half goes first next time, a whole one is lost.
        self._rest = data[n:] if 0 < n < len(data) else self._rest if n == 0 else b""

    def _over_the_wire(self, data: bytes) -> bytes:
        """Return what arrives at the other end: something else where the two have not the same speed."""
        if self._board.baud and self._speed() != self._board.baud:
            return bytes(self._rng.randrange(256) for _ in data)
        return data

    def _speed(self) -> int:
        assert self._ends is not None
        code = termios.tcgetattr(self._ends[1])[5]
        for baud in (9600, 38400, 57600, 115200, 230400, 460800, 500000, 1000000, 2000000):
            if getattr(termios, f"B{baud}", None) == code:
                # Nobody has opened the port yet: it has the speed it was made with.
                return self._board.baud if baud == 38400 else baud
        return 0

    def _obey(self) -> bool:
        """Carry out the lines typed; return whether to go on."""
        data = os.read(sys.stdin.fileno(), 4096)
        if not data:
            return False
        *lines, self._typed = (self._typed + data).split(b"\n")
        for line in lines:
            text = line.decode("ascii", "replace")
            if text.split() == ["quit"]:
                return False
            obey(text, self._do)
        return True

    def _do(self, words: list[str]) -> dict[str, Any]:
        verb = words[0]
        if verb == "unplug":
            self.unplug()
        elif verb == "plug":
            self.unplug()
            self._plug()
        elif verb == "reset":
            self._send(self._board.power_on())
        elif verb == "heard":
            return {"heard": self._received.hex()}
        elif verb == "sent":
            return {"sent_ns": list(self._sent_ns)}
        elif verb == "clear":
            self._faults.clear()
        elif verb == "signal":
            self._signal.set(words[1], int(words[2]) if len(words) > 2 else None)
        elif verb == "rows":
            self._signal.play(Path(words[1]))
        elif verb == "effort":
            self._signal.set_effort(float(words[1]), int(words[2]) if len(words) > 2 else None)
        else:
            self._faults.set(verb, float(words[1]) if len(words) > 1 else 1.0)
        return {"port": self.port}
