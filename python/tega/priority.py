"""Lets a thread of a run go before other programs, where the system allows it.

On a busy machine a thread that has been woken may wait some milliseconds for a core, which is more than all it then
does. Linux gives real-time threads theirs at once: to root, and to whoever ``ulimit -r`` allows a priority. Elsewhere,
or without leave, all goes on as before. The kernel keeps a twentieth of the time for others, whatever such a thread
does, and processes that it starts are ordinary ones.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["ahead_of_others"]

# Low among real-time threads: the kernel's own, of drivers and interrupts, go first.
_PRIORITY = 5
_LAST = 1


@contextmanager
def ahead_of_others(*, last: bool = False, inherited: bool = False) -> Iterator[bool]:
    """Ask for it for the calling thread and this block.

    Args:
        last: Go after the run's other threads. A thread that nobody waits for holds the interpreter at times, and must
            not lose its core to another program just then.
        inherited: Threads that are started in the block keep it; none of them may start a process.

    Yields:
        Whether it was granted, or was so before.
    """
    if sys.platform != "linux":
        yield False
        return
    before, how = os.sched_getscheduler(0), os.sched_getparam(0)
    if before & ~os.SCHED_RESET_ON_FORK in {os.SCHED_FIFO, os.SCHED_RR}:
        yield True
        return
    try:
        policy = os.SCHED_RR if inherited else os.SCHED_RR | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, policy, os.sched_param(_LAST if last else _PRIORITY))
    except OSError:  # not allowed
        yield False
        return
    try:
        yield True
    finally:
        os.sched_setscheduler(0, before, how)
