"""The emulated Allegro Hand as a program: behind a serial CAN adapter (SLCAN on a pseudo-terminal), or on a CAN bus.

``python -m tega_emulators.allegro_port`` prints the options of the ``allegro`` driver that reach it and then
obeys lines on its standard input: the name of a fault, ``clear``, ``limit SLEW`` and 16 torques (what to count as too
much), ``answers`` (how long after each set of positions since the last such question its torques came in), or
``look``; it answers each with the hand's state (``servo_on``, ``duties`` and ``angles_rad`` of the 16 joints,
``torques``: frames received, ``over``: those beyond a limit, ``reports``: whether it sends positions, ``pushed_s``,
``zero_s`` and ``off_s``: the machine's monotonic time of the last torque that was not zero, of the last change to zero
torque, and of the last SERVO OFF).

Options: ``--hardware 0x0500``, ``--side left``, ``--device-id``, ``--seed``, and
``--interface udp_multicast --channel 239.74.163.2`` for a bus of python-can's instead of a terminal, ``--channel
network`` for a serial adapter behind a network connection.
"""

from __future__ import annotations

import argparse
import os
import select
import socket
import struct
import sys
import time
from functools import partial
from typing import Any

import numpy as np

from tega_emulators.allegro import AllegroNode, Frame
from tega_emulators.pipe import notify, obey

__all__ = ["BusPort", "SlcanNetworkPort", "SlcanPort", "main"]

_IDLE_S = 0.05
_SO_TIMESTAMPNS = 35  # Linux's, which Python does not name
_TIMESPEC = struct.Struct("qq")


class SlcanPort:
    """A serial CAN adapter with the hand behind it: ASCII lines that end with a carriage return.

    ``channel`` is the terminal's path, for the other side; ``garbage`` puts noise between the lines.
    """

    def __init__(self, node: AllegroNode) -> None:
        """Open a pseudo-terminal in raw mode."""
        import pty
        import tty

        self._node = node
        # The other end stays open here as well, so that it survives its user.
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.channel = os.ttyname(self._slave)
        self.garbage = False
        self._open = False
        self._pending = b""

    def fileno(self) -> int:
        """The file to wait for."""
        return self._master

    def take(self, t_s: float) -> None:
        """Obey what has come in."""
        try:
            piece, t_s = self._read(t_s)
        except (BlockingIOError, OSError):
            return
        self._pending += piece
        *lines, self._pending = self._pending.split(b"\r")
        for line in lines:
            self._obey(line, t_s)

    def _read(self, t_s: float) -> tuple[bytes, float]:
        """Return what has come in, and when."""
        return os.read(self._master, 65536), t_s

    def _obey(self, line: bytes, t_s: float) -> None:
        kind = line[:1]
        if kind in {b"O", b"C"}:
            self._open = kind == b"O"
            self._say(b"\r")
        elif kind in {b"t", b"r"} and self._open:
            can_id, length = int(line[1:4], 16), int(line[4:5])
            data = bytes.fromhex(line[5 : 5 + 2 * length].decode()) if kind == b"t" else b""
            self._say(b"z\r")
            self.send(self._node.receive(can_id, data, remote=kind == b"r", t_s=t_s))
        elif line:
            self._say(b"\r")

    def send(self, frames: list[Frame]) -> None:
        """Pass on what the hand sends."""
        if not (self._open and frames):
            return
        lines = [f"t{can_id:03X}{len(data)}{data.hex().upper()}\r" for can_id, data in frames]
        if self.garbage:
            lines.insert(len(lines) // 2, "t08\x7f8zz\rQ\r")
        self._say("".join(lines).encode())

    def _say(self, text: bytes) -> None:
        # An adapter whose host does not read loses frames as well.
        try:
            os.write(self._master, text)
        except (BlockingIOError, OSError):
            return


class SlcanNetworkPort(SlcanPort):
    """The same adapter behind a network connection to this machine, as a serial server gives it.

    What a terminal carries waits for a thread of the kernel that has no real time, up to milliseconds on a busy
    machine; what a connection carries is there at once. On Linux the system stamps what comes in, so that the hand's
    clock does not count how long this program waited for a processor.
    """

    def __init__(self, node: AllegroNode) -> None:
        """Listen; the client that connected last has the adapter."""
        self._node = node
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._listener.settimeout(0)
        self._waiting = select.epoll()
        self._waiting.register(self._listener, select.EPOLLIN)
        self._peer: socket.socket | None = None
        self.channel = f"socket://127.0.0.1:{self._listener.getsockname()[1]}"
        self.garbage = False
        self._open = False
        self._pending = b""

    def fileno(self) -> int:
        """The file to wait for."""
        return self._waiting.fileno()

    def take(self, t_s: float) -> None:
        """Obey what has come in, from every client."""
        for fd, _ in self._waiting.poll(0):
            if fd == self._listener.fileno():
                self._hang_up()
                self._peer, _ = self._listener.accept()
                self._peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._peer.settimeout(0)
                if sys.platform == "linux":
                    self._peer.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
                self._waiting.register(self._peer, select.EPOLLIN)
                self._master = self._peer.fileno()
            elif self._peer is not None and not self._peer.recv(1, socket.MSG_PEEK):
                self._hang_up()
            elif self._peer is not None:
                super().take(t_s)

    def _read(self, t_s: float) -> tuple[bytes, float]:
        assert self._peer is not None
        piece, notes, _, _ = self._peer.recvmsg(65536, socket.CMSG_SPACE(_TIMESPEC.size))
        for level, kind, value in notes:
            if (level, kind) == (socket.SOL_SOCKET, _SO_TIMESTAMPNS):
                seconds, nanoseconds = _TIMESPEC.unpack(value)
                t_s = time.monotonic() - 1e-9 * (time.time_ns() - seconds * 10**9 - nanoseconds)
        return piece, t_s

    def _hang_up(self) -> None:
        if self._peer is not None:
            self._waiting.unregister(self._peer)
            self._peer.close()
        self._peer, self._open, self._pending = None, False, b""

    def _say(self, text: bytes) -> None:
        if self._peer is not None:
            super()._say(text)


class BusPort:
    """The hand on one of python-can's buses; ``channel`` is the bus's name."""

    garbage = False

    def __init__(self, node: AllegroNode, *, interface: str, channel: str) -> None:
        """Join the bus."""
        import can

        self._can: Any = can
        self._node = node
        self._bus: Any = can.Bus(interface=interface, channel=channel)
        self.channel = channel

    def fileno(self) -> int:
        """The file to wait for; virtual buses have none."""
        return int(self._bus.fileno())

    def take(self, t_s: float) -> None:
        """Receive every frame that has come."""
        while (message := self._bus.recv(timeout=0)) is not None:
            if not (message.is_extended_id or message.is_error_frame):
                remote = message.is_remote_frame
                answers = self._node.receive(
                    message.arbitration_id, bytes(message.data), remote=remote, t_s=t_s
                )
                self.send(answers)

    def send(self, frames: list[Frame]) -> None:
        """Pass on what the hand sends."""
        for can_id, data in frames:
            self._bus.send(self._can.Message(arbitration_id=can_id, data=data, is_extended_id=False))

    def close(self) -> None:
        """Leave the bus."""
        self._bus.shutdown()


def main(arguments: list[str] | None = None) -> None:
    """Run until the standard input ends."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hardware", type=lambda text: int(text, 0), default=0x0402)
    parser.add_argument("--side", choices=("right", "left"), default="right")
    parser.add_argument("--device-id", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--interface", default="slcan")
    parser.add_argument("--channel", default="")
    given = parser.parse_args(arguments)
    node = AllegroNode(hardware=given.hardware, side=given.side, device_id=given.device_id, seed=given.seed)
    port: SlcanPort | BusPort
    if given.interface != "slcan":
        port = BusPort(node, interface=given.interface, channel=given.channel)
    elif given.channel == "network":
        port = SlcanNetworkPort(node)
    else:
        port = SlcanPort(node)
    address: dict[str, Any] = {"interface": given.interface, "channel": port.channel}
    notify(address | ({"bus": {"sleep_after_open": 0.0}} if given.interface == "slcan" else {}))
    pending = b""
    while True:
        wait_s = min(max(node.next_s() - time.monotonic(), 0.0), _IDLE_S)
        ready, _, _ = select.select([port, sys.stdin.fileno()], [], [], wait_s)
        if port in ready:
            port.take(time.monotonic())
        if sys.stdin.fileno() in ready:
            chunk = os.read(sys.stdin.fileno(), 4096)
            if not chunk:
                return
            *lines, pending = (pending + chunk).split(b"\n")
            for line in lines:
                obey(line.decode("ascii", "replace"), partial(_act, node, port))
        port.send(node.due(time.monotonic()))


def _act(node: AllegroNode, port: SlcanPort | BusPort, line: list[str]) -> dict[str, Any]:
    words = " ".join(line)
    if words == "answers":
        answers_s, node.answers_s = node.answers_s, []
        return {"answers_ms": [round(1e3 * took_s, 3) for took_s in answers_s]}
    if words == "garbage":
        port.garbage = True
    elif words.startswith("limit "):
        node.slew_limit, *limits = map(float, words.split()[1:])
        node.torque_limits = np.array(limits)
    elif words != "look":
        port.garbage = port.garbage and words != "clear"
        node.command(words)
    return {
        "t_s": time.monotonic(),
        "servo_on": node.servo_on,
        "over": node.n_over,
        "torques": node.n_torques,
        "duties": [float(duty) for duty in node.duties],
        "angles_rad": node.angles_rad,
        "reports": node.next_s() < float("inf"),
        "pushed_s": max(node.pushed_s, 0.0),
        "zero_s": max(node.zero_s, 0.0),
        "off_s": max(node.off_s, 0.0),
    }


if __name__ == "__main__":
    main()
