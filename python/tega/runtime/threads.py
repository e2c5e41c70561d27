"""Give the threads of a run real-time priority, in the right order, where the system allows it.

On a busy machine a thread that has been woken may wait some milliseconds for a core, longer than all of its work.
Linux gives real-time threads a core at once: for root, and for users to whom ``ulimit -r`` allows a priority.
Elsewhere, without permission, or with ``session.realtime = false``, nothing changes. The kernel reserves a twentieth
of the time for other threads, and processes that a real-time thread starts are ordinary ones.

=========== ======== =====================================================================================
rank        priority whose
=========== ======== =====================================================================================
``hand``    9        the hand's process and who drains a serial port: nobody in the run waits for what they hold
``act``     8        the loop, the vest's thread, the muscles', the hand's reader: short, and somebody waits for it
``measure`` 6        a camera's: it looks at a picture and measures it, in less than a millisecond
``beside``  4        everything else in the program, and the recorder's process
``picture`` 2        coding a picture, which takes 1 to 2 ms without the interpreter lock
=========== ======== =====================================================================================

Threads that may hold the interpreter lock go before threads that do not: a thread that loses its core while it holds
the lock blocks all others. So a camera's thread lowers its priority only while it decodes (:func:`give_way`), and the
recorder's while it encodes. Sources wake the loop by a :class:`Bell`, so that it need not wait for the next tick.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final, Literal

from tega.runtime.clock import every

Rank = Literal["hand", "act", "measure", "beside", "picture"]

# Low among real-time threads: the kernel's own, of drivers and interrupts, go first.
_PRIORITY: Final[dict[Rank, int]] = {"hand": 9, "act": 8, "measure": 6, "beside": 4, "picture": 2}
# As Linux numbers its policies; elsewhere none of them is asked for.
_OTHER, _FIFO, _RR, _RESET_ON_FORK = 0, 1, 2, 0x40000000
_SWEEP_S = 1.0
_TURN_S = 0.0005

_state = {"allowed": True}


@contextmanager
def realtime(*, allowed: bool) -> Iterator[None]:
    """Allow or forbid real-time priority, for this block and the whole program."""
    before, _state["allowed"] = _state["allowed"], allowed
    try:
        yield
    finally:
        _state["allowed"] = before


def realtime_allowed() -> bool:
    """Whether real-time priority may be requested, so that a process of the same run can do the same."""
    return _state["allowed"]


def spare_threads() -> None:
    """Have NumPy and OpenCV, if imported after this, start no threads for matrices: in a run they would idle."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


@contextmanager
def short_turns() -> Iterator[None]:
    """Have a thread hold the interpreter lock for half a millisecond at most, for this block and the whole program.

    Python lets it hold the lock for 5 ms, which is longer than a tick of the hand.
    """
    before_s = sys.getswitchinterval()
    sys.setswitchinterval(min(before_s, _TURN_S))
    try:
        yield
    finally:
        sys.setswitchinterval(before_s)


@contextmanager
def run_realtime(rank: Rank, *, inherited: bool = False) -> Iterator[bool]:
    """Ask for real-time priority for the calling thread and this block; yield whether it has it.

    ``inherited`` means that threads started in the block keep it; none of them may start a process.
    """
    how = _how(0) if _state["allowed"] else None
    has_it = how is not None and _is_realtime(how) and how[1] >= _PRIORITY[rank]
    if how is None or has_it or not _set(0, rank, inherited=inherited):
        yield has_it
        return
    try:
        yield True
    finally:
        _put(0, *how)


@contextmanager
def give_way() -> Iterator[None]:
    """Lower the calling thread, if it has a rank, to ``picture`` for this block, which holds no interpreter lock."""
    how = _how(0) if _state["allowed"] else None
    if how is None or not _is_realtime(how):
        yield
        return
    _set(0, "picture")
    try:
        yield
    finally:
        _put(0, *how)


def promote(thread: threading.Thread, rank: Rank) -> bool:
    """Ask for another thread's real-time priority, such as a library's, until that ends; return whether it came."""
    return _possible() and thread.native_id is not None and _set(thread.native_id, rank)


@contextmanager
def all_along() -> Iterator[None]:
    """Give the rank ``beside`` to all threads that have none, and to those that begin, for this block."""
    if not _possible():
        yield
        return
    brought: set[int] = set()

    def sweep() -> None:
        for thread in threading.enumerate():
            tid = thread.native_id
            how = None if tid is None else _how(tid)
            is_ordinary = how is not None and how[0] & ~_RESET_ON_FORK == _OTHER
            if tid is not None and is_ordinary and promote(thread, "beside"):
                brought.add(tid)

    try:
        with every(sweep, every_s=_SWEEP_S):
            yield
    finally:
        for left in threading.enumerate():
            if left.native_id in brought:
                _put(left.native_id, _OTHER, 0)


@contextmanager
def restored() -> Iterator[None]:
    """Give back the priority that a library takes for itself in this block, before every other program.

    The video encoder SVT-AV1 does so where it runs as root, for the calling thread and all threads of its own.
    """
    before = {tid: how for tid in _threads() if (how := _how(tid)) is not None}
    try:
        yield
    finally:
        for tid in _threads():
            how = _how(tid)
            if (
                how is not None and how != before.get(tid) and how[0] & ~_RESET_ON_FORK == _FIFO
            ):  # ours are SCHED_RR
                _put(tid, *before.get(tid, (_OTHER, 0)))


def _threads() -> list[int]:
    """Return all threads of this program, a library's as well; none where there is no ``/proc``."""
    return [int(task.name) for task in Path("/proc/self/task").glob("*")]


def _how(tid: int) -> tuple[int, int] | None:
    """Return a thread's policy and priority; ``None`` once it has ended, and for another system."""
    if sys.platform != "linux":
        return None
    try:
        return os.sched_getscheduler(tid), os.sched_getparam(tid).sched_priority
    except OSError:
        return None


def _put(tid: int, policy: int, priority: int) -> bool:
    """Give a thread a policy and a priority; false if that is not allowed, or it has ended."""
    if sys.platform != "linux":
        return False
    try:
        os.sched_setscheduler(tid, policy, os.sched_param(priority))
    except OSError:
        return False
    return True


def _set(tid: int, rank: Rank, *, inherited: bool = False) -> bool:
    return _put(tid, _RR if inherited else _RR | _RESET_ON_FORK, _PRIORITY[rank])


def _possible() -> bool:
    return sys.platform == "linux" and _state["allowed"]


def _is_realtime(how: tuple[int, int]) -> bool:
    return how[0] & ~_RESET_ON_FORK in {_FIFO, _RR}


class Bell:
    """Rung by the sources' threads to wake the loop; several rings before the loop wakes count once."""

    def __init__(self) -> None:
        # A lock that is held while nothing has happened: the one thing Python waits for without code of its own.
        self._silent = threading.Lock()
        self._silent.acquire()

    def ring(self) -> None:
        """Wake the waiting thread, or the next one that waits."""
        with contextlib.suppress(RuntimeError):  # rung already
            self._silent.release()

    def wait(self, timeout_s: float) -> bool:
        """Wait for a ring; without time left none is looked for."""
        return timeout_s > 0 and self._silent.acquire(timeout=timeout_s)
