"""Keep a bare clock of 3 ms in a process of its own beside a run, as the witness of how late this machine is.

It waits as the loop waits, at the priority of the hand's process, in native code and without a device, a computation
or an interpreter lock: what is late here is so by the machine and by what else runs on it.
"""

from __future__ import annotations

import json
import subprocess
import sys
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import msgspec

from tega.loop.hand import HAND_TICK_NS
from tega.loop.pacing import LATE_EDGES_NS
from tega.runtime.child_process import end_child, python_command, python_environment
from tega.runtime.threads import run_realtime

__all__ = ["BareClock", "LateTicks", "witness"]

_PATIENCE_S = 5.0


class LateTicks(msgspec.Struct, frozen=True, kw_only=True):
    """How late the ticks of a clock came, by the bins of :data:`tega.loop.pacing.LATE_EDGES_NS`."""

    ticks: int
    late: tuple[int, ...]
    over_1_ms: int
    worst_ms: float

    @classmethod
    def of_bins(cls, late: Sequence[int], *, worst_ms: float) -> LateTicks:
        """Return the figures of a histogram by these bins."""
        over = sum(late[LATE_EDGES_NS.index(1_000_000) + 1 :])
        return cls(ticks=sum(late), late=tuple(late), over_1_ms=over, worst_ms=worst_ms)

    @classmethod
    def of(cls, late_ns: Sequence[int]) -> LateTicks:
        """Count ticks by how late they came, nanoseconds."""
        late = [0] * (len(LATE_EDGES_NS) + 1)
        for ns in late_ns:
            late[bisect_left(LATE_EDGES_NS, ns)] += 1
        return cls.of_bins(late, worst_ms=max(late_ns, default=0) / 1e6)


class BareClock:
    """A process that is ready to keep the clock."""

    def __init__(self, process: subprocess.Popen[bytes]) -> None:
        self._process = process

    def begin(self, seconds: float) -> None:
        """Have it keep the clock for so long from now on."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{round(seconds * 1e9) // HAND_TICK_NS}\n".encode())
        self._process.stdin.flush()

    def late(self) -> LateTicks:
        """Wait until it is done, and return how late its ticks came."""
        assert self._process.stdout is not None
        return LateTicks.of(json.loads(self._process.stdout.readline()))


@contextmanager
def witness() -> Iterator[BareClock]:
    """Start a witness, which asks for the priority of the hand's process, and end it with the block."""
    with subprocess.Popen(
        python_command(__name__),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=python_environment(),
    ) as process:
        try:
            assert process.stdout is not None
            process.stdout.readline()
            yield BareClock(process)
        finally:
            end_child(process, _PATIENCE_S)


def _keep() -> None:
    """Report that the process is there, wait for a number of ticks, keep them, print how late each came."""
    from tega import _native

    print("ready", flush=True)
    if not (n_ticks := sys.stdin.readline()):
        return
    with run_realtime("hand"):
        late_ns = _native.bare_clock(HAND_TICK_NS, int(n_ticks))
    print(json.dumps(late_ns), flush=True)


if __name__ == "__main__":
    _keep()
