"""A wire between two network namespaces that loses, delays and reorders packets; needs root and Linux.

It does what netem does, for kernels that have none: packets pass through this program, from one TUN device to another,
so that TCP on both sides is the kernel's own and has to cope. The namespace is called like the wire; programs in it are
started with ``wire.inside``.

Example::

    with LossyWire() as wire:
        wire.loss = 0.05
        subprocess.run([*wire.inside, "ping", wire.here])
"""

from __future__ import annotations

import fcntl
import heapq
import os
import random
import select
import struct
import subprocess
import sys
import threading
import time
from contextlib import ExitStack
from types import TracebackType
from typing import Self

from tega.errors import DeviceUnavailableError

__all__ = ["LossyWire"]

# Numbers of Linux's if_tun.h.
_SET_INTERFACE, _TUN, _NO_HEADER = 0x400454CA, 0x0001, 0x1000
_PACKET_BYTES = 2048
_REORDER_MS = 10.0


class LossyWire:
    """A wire from this network namespace to one of its own; it ends with the block.

    Args:
        seed: Of chance.

    Attributes:
        here: Address of this end.
        inside: What is put in front of a command to run it at the other end.
        delay_ms: Each packet takes so long.
        loss: Share of packets that never arrive.
        reorder: Share of packets that come 10 ms later than they would, so that others overtake them.
        lost: Packets lost so far.
        passed: Packets that came through.
        late: Packets that were sent later than others behind them.
    """

    here = "10.77.201.1"

    def __init__(self, *, seed: int = 0) -> None:
        self._name = f"tega{os.getpid()}"
        self.inside = ("ip", "netns", "exec", self._name)
        self.delay_ms = self.loss = self.reorder = 0.0
        self.lost = self.passed = self.late = 0
        self._random = random.Random(seed)
        self._over = threading.Event()
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        """Set it up.

        Raises:
            DeviceUnavailableError: It cannot be made here.
        """
        if sys.platform != "linux" or os.geteuid() != 0:
            raise DeviceUnavailableError(
                "a wire between namespaces needs Linux and root", "go without --wire"
            )
        with ExitStack() as stack:
            try:
                _run("ip", "netns", "add", self._name)
                stack.callback(_run, "ip", "netns", "del", self._name)
                ends = [self._tun(f"tegaw{k}", stack) for k in (0, 1)]
                _run("ip", "link", "set", "tegaw1", "netns", self._name)
                other = "10.77.201.2"
                for before, device, own, peer in (
                    ((), "tegaw0", self.here, other),
                    (self.inside, "tegaw1", other, self.here),
                ):
                    _run(*before, "ip", "addr", "add", own, "peer", peer, "dev", device)
                    _run(*before, "ip", "link", "set", device, "up")
                _run(*self.inside, "ip", "link", "set", "lo", "up")
            except (OSError, subprocess.CalledProcessError) as error:
                raise DeviceUnavailableError(f"no wire can be made: {error}", "go without --wire") from error
            thread = threading.Thread(target=self._carry, args=(*ends,), name="tega-wire", daemon=True)
            thread.start()
            stack.callback(thread.join, 5.0)
            stack.callback(self._over.set)
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Take it away."""
        self._stack.close()

    def _tun(self, name: str, stack: ExitStack) -> int:
        end = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
        stack.callback(os.close, end)
        fcntl.ioctl(end, _SET_INTERFACE, struct.pack("16sH22x", name.encode(), _TUN | _NO_HEADER))
        return end

    def _carry(self, one: int, other: int) -> None:
        waiting: list[tuple[float, int, int, bytes]] = []
        n = 0
        while not self._over.is_set():
            wait_s = 0.05 if not waiting else min(0.05, max(0.0, waiting[0][0] - time.monotonic()))
            ready, _, _ = select.select([one, other], [], [], wait_s)
            now_s = time.monotonic()
            for end in ready:
                packet = os.read(end, _PACKET_BYTES)
                if self._random.random() < self.loss:
                    self.lost += 1
                    continue
                due_s = now_s + self.delay_ms / 1e3
                if self._random.random() < self.reorder:
                    due_s += _REORDER_MS / 1e3
                    self.late += 1
                n += 1
                heapq.heappush(waiting, (due_s, n, other if end == one else one, packet))
            while waiting and waiting[0][0] <= now_s:
                _, _, end, packet = heapq.heappop(waiting)
                os.write(end, packet)
                self.passed += 1


def _run(*command: str) -> None:
    subprocess.run(command, check=True, capture_output=True)
