"""Call functions every so many seconds while a block runs: all of a program's in one thread, in turn."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class _Call:
    """A function that is called again and again."""

    def __init__(self, action: Callable[[], object], every_s: float) -> None:
        self.action, self.every_s, self.due_s = action, every_s, time.monotonic()


class _Turns:
    """The thread that makes the calls; it is there while there are any."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._calls: list[_Call] = []
        self._now: _Call | None = None
        self._thread: threading.Thread | None = None

    def begin(self, call: _Call) -> None:
        """Make a call from now on."""
        with self._changed:
            self._calls.append(call)
            self._changed.notify_all()
            if self._thread is None:
                self._thread = threading.Thread(target=self._work, name="tega-every", daemon=True)
                self._thread.start()

    def end(self, call: _Call) -> None:
        """Make it no more; returns when the last one has returned."""
        with self._changed:
            if call in self._calls:
                self._calls.remove(call)
                self._changed.notify_all()
            self._changed.wait_for(lambda: self._now is not call)

    def _work(self) -> None:
        with self._changed:
            while self._calls:
                call = min(self._calls, key=lambda call: call.due_s)
                if (rest_s := call.due_s - time.monotonic()) > 0:
                    self._changed.wait(rest_s)
                    continue
                self._now = call
                self._changed.release()
                try:
                    failed = _failed(call)
                finally:
                    self._changed.acquire()
                self._now, call.due_s = None, time.monotonic() + call.every_s
                if failed and call in self._calls:
                    self._calls.remove(call)
                self._changed.notify_all()
            self._thread = None


def _failed(call: _Call) -> bool:
    """Make a call; an exception is reported like that of a dying thread, and ends the calls."""
    try:
        call.action()
    # A panic of native code, too: whoever ends a block would wait for this call for ever.
    except BaseException:
        threading.excepthook(threading.ExceptHookArgs((*sys.exc_info(), threading.current_thread())))
        return True
    return False


_turns = _Turns()


@contextmanager
def every(action: Callable[[], object], *, every_s: float) -> Iterator[None]:
    """Call a function at once, and again after each rest, in another thread; the block ends after the last call.

    The calls of a program share that thread, so one that takes long delays the others.
    """
    call = _Call(action, every_s)
    _turns.begin(call)
    try:
        yield
    finally:
        _turns.end(call)
