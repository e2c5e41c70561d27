"""Run a process that leaves a device safe when the program that uses the device is killed or stands still.

Only the program ends it (:func:`tega.runtime.child_process.start_child`). It does not end before the device has
confirmed, and writes to the system's log where the device does not, since it has no visible output.

The program starts it before anything of the device is switched on, and waits until it says ``ready``. It then writes a
line ``.`` ten times a second, which the process answers in kind. A line ``done`` ends the process; the end of its input
without one means that the program is gone. The process then answers ``alone``, and ``off`` once the device has
confirmed.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from queue import Empty, SimpleQueue
from typing import Final

from tega.errors import DeviceUnavailableError
from tega.runtime.child_process import end_child, start_child

BEAT_S: Final = 0.1
STUCK_S: Final = 1.0
"""A program that has sent messages and is then silent for this long is hanging."""

DEAF_S: Final = 2.0
"""A process that has not answered for so long is taken for lost."""

_READY_S: Final = 10.0
_AGAIN_S: Final = 1.0
_LEAVE_S: Final = 5.0
_HAS_IT: Final = b"alone\n"
_OFF: Final = b"off\n"
# Processes that go on trying after this program has closed its device; kept so that nobody waits for them.
_left: list[subprocess.Popen[bytes]] = []


class GuardProcess:
    """Starts and feeds the guard of a device from the program that it watches; one that is lost is replaced.

    ``problem`` is why there is none now, ``""`` while there is one; ``confirmed``: the device that was left
    to it has confirmed that it is safe. ``DeviceUnavailableError``: it does not start, so that the device
    must not be switched on.
    """

    def __init__(self, subject: str, module: str, *arguments: str) -> None:
        self._subject = subject
        self._module, self._arguments = module, arguments
        self._closing, self._safe = threading.Event(), False
        self._swap = threading.Lock()  # of the process, against the program's leaving
        self._next_s = 0.0
        self._has_it, self._is_off = threading.Event(), threading.Event()
        self.n_lost = 0
        self.problem = ""
        self._requested_s = self._received_s = time.monotonic()
        self._process = self._start()
        self._thread = threading.Thread(target=self._watch, name="tega-guard", daemon=True)
        self._thread.start()

    @property
    def pid(self) -> int:
        """The process's number."""
        return self._process.pid

    def beat(self) -> None:
        """Report to the guard that the program is alive; returns at once, and mostly does nothing."""
        now_s = time.monotonic()
        if now_s < self._next_s or self.problem:
            return
        self._next_s = now_s + BEAT_S
        if self._requested_s - self._received_s > DEAF_S:
            self._process.kill()  # it stands still: the thread that watches it sees its end
            return
        self._requested_s = now_s
        self._write(b".\n", self._process)

    def dismiss(self) -> None:
        """Report to the guard that the device is safe, and wait for the guard's end."""
        self._leave(safe=True)
        self._thread.join(_LEAVE_S)

    def leave_to_it(self, *, confirm_s: float = 0.0) -> int:
        """Leave the device to the guard: to it this looks as if the program were gone, and it goes on trying.

        Waits until a guard has answered that it has the device. One that was lost is replaced first; one that
        stands still is ended and replaced. Returns the number of the process that has the device; 0 where
        none has answered.
        """
        self._leave(safe=False)
        if not self._has_it.wait(DEAF_S):
            if not self.problem:
                self._process.kill()  # it stands still: the thread that watches it starts another
            if not self._has_it.wait(_READY_S):
                return 0
        self._is_off.wait(confirm_s)
        return self._process.pid

    @property
    def confirmed(self) -> bool:
        """Whether the device that was left to the guard has confirmed that it is safe."""
        return self._is_off.is_set()

    def _leave(self, *, safe: bool) -> None:
        with self._swap:
            self._safe, process = safe, self._process
            self._closing.set()
        self._part_from(process)

    def _part_from(self, process: subprocess.Popen[bytes]) -> None:
        """End a process where the device has been left safe, else leave the device to it."""
        if self._safe:
            self._write(b"done\n", process)
            end_child(process, _LEAVE_S)
            return
        _left.append(process)
        if process.stdin is not None:
            with contextlib.suppress(OSError):
                process.stdin.close()

    def _start(self) -> subprocess.Popen[bytes]:
        process = start_child(self._module, *self._arguments, stdout=subprocess.PIPE)
        late = threading.Timer(_READY_S, process.kill)
        late.start()
        answer = process.stdout.readline() if process.stdout else b""
        late.cancel()
        if answer.strip() != b"ready":
            process.kill()
            _forget(process)
            raise DeviceUnavailableError(
                f"the process that {self._subject} did not start",
                "its error output says why; nothing was switched on",
            )
        # Windows has no such pipes: what is written fits, since a process that receives nothing is ended after 2 s.
        if process.stdin is not None and sys.platform != "win32":
            os.set_blocking(process.stdin.fileno(), False)
        self._requested_s = self._received_s = time.monotonic()
        return process

    def _write(self, line: bytes, process: subprocess.Popen[bytes]) -> None:
        if process.stdin is not None:
            with contextlib.suppress(OSError, ValueError):  # it is gone: the thread that watches it sees that
                os.write(process.stdin.fileno(), line)

    def _watch(self) -> None:
        """Read the answers, and restart the process if it is gone."""
        while True:
            process = self._process
            if process.stdout is not None:
                while line := process.stdout.readline():
                    self._received_s = time.monotonic()
                    if line == _HAS_IT and self._closing.is_set():
                        self._has_it.set()
                    elif line == _OFF:
                        self._is_off.set()
                process.stdout.close()
            if self._closing.is_set() and (self._safe or self._has_it.is_set()):
                return  # else it was lost as the device was left to it
            self.n_lost += 1
            self.problem = f"the process that {self._subject} was lost; another is being started"
            _forget(process)
            while self.problem and not self._safe:
                try:
                    process = self._start()
                except (DeviceUnavailableError, OSError):
                    time.sleep(_AGAIN_S)
                    continue
                # Until it has received something it takes the device for switched off.
                self._write(b".\n", process)
                with self._swap:
                    self._process, closing = process, self._closing.is_set()
                if closing:
                    self._part_from(process)
                self.problem = ""


def _forget(process: subprocess.Popen[bytes]) -> None:
    end_child(process, _LEAVE_S)
    if process.stdout is not None:
        process.stdout.close()


def stand_by(device: str, let_go: Callable[[Callable[[], bool]], str]) -> None:
    """Wait, in the guard's process, and leave the device safe if the program vanishes or stands still.

    Before the first message of the program nothing of the device is on, and the process does nothing.
    ``let_go`` leaves the device safe, trying until the device confirms; its argument returns whether the
    program goes on, and its result is ``""``, or the reason why the device has not confirmed. ``device`` is
    for the system's log.
    """
    _answer(b"ready\n")
    pieces = receive()
    received, stuck, tail = False, False, b""
    while True:
        try:
            piece = pieces.get(timeout=STUCK_S if received and not stuck else None)
        except Empty:
            piece = None
        tail = (tail + (piece or b""))[-64:]
        if b"done" in tail:
            return
        if piece:
            _answer(b".\n" * piece.count(b"."))
            received, stuck = True, False
            continue
        gone = piece is not None
        if gone:
            stay_alone()
        if received:
            alarm = Alarm(device)
            why = let_go((lambda: False) if gone else lambda: not pieces.empty())
            alarm.end(why if gone else "")
            if gone and not why:
                _answer(_OFF)
        if gone:
            return
        stuck = True


def receive() -> SimpleQueue[bytes]:
    """Return, in the guard's process, a queue of the program's messages in pieces; an empty one is the last.

    A thread reads, since Windows cannot wait for a pipe and a time at once.
    """
    orders: SimpleQueue[bytes] = SimpleQueue()
    fd = sys.stdin.fileno()

    def listen() -> None:
        while True:
            piece = os.read(fd, 4096)
            orders.put(piece)
            if not piece:
                return

    threading.Thread(target=listen, name="tega-hears", daemon=True).start()
    return orders


def stay_alone() -> None:
    """Answer, in the process, that the device is its own now, and let go of the error output of the parent.

    Another program may be reading that to its end.
    """
    _answer(_HAS_IT)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stderr.fileno())
    os.close(nowhere)


def _answer(line: bytes) -> None:
    """Send a line to the parent, unless it is gone."""
    with contextlib.suppress(OSError):
        os.write(sys.stdout.fileno(), line)


_OVERDUE_S: Final = 5.0


class Alarm:
    """Writes to the system's log if a device does not confirm in time, and how that ended."""

    def __init__(self, device: str) -> None:
        self._device, self._overdue = device, False
        self._timer = threading.Timer(_OVERDUE_S, self._raise)
        self._timer.daemon = True
        self._timer.start()

    def end(self, why: str) -> None:
        """Take note that nothing more is tried, and why the device has not confirmed; ``""`` if it has."""
        self._timer.cancel()
        if why:
            log_to_system(f"{self._device}: not confirmed to be off ({why}): use its switch")
        elif self._overdue:
            log_to_system(f"{self._device}: the alert is over")

    def _raise(self) -> None:
        self._overdue = True
        log_to_system(
            f"{self._device}: not confirmed to be off after {_OVERDUE_S:g} s: use its switch; "
            f"process {os.getpid()} goes on trying"
        )


def log_to_system(message: str) -> None:
    """Write an alert to the system's log, where the system has one that Python knows."""
    if sys.platform == "win32":
        return
    import syslog

    syslog.openlog("tega", syslog.LOG_PID, syslog.LOG_DAEMON)
    syslog.syslog(syslog.LOG_ALERT, message)
