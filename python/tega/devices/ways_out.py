"""Closes what must not be left as it is when the program ends: on exit, and on a request to terminate.

A ``with`` block closes its devices when it is left, by an exception too. Two ways out pass it by: a program that
forgets it, and SIGTERM, which ends Python at once unless somebody handles it. While a device is registered here,
``close`` is called when the interpreter exits, and SIGTERM or SIGHUP (the terminal is closed) raises ``SystemExit`` in
the main thread, unless the program has a handler of its own. Nothing runs on SIGKILL or a power cut.
"""

from __future__ import annotations

import atexit
import signal
import threading
from collections.abc import Callable
from types import FrameType

__all__ = ["closes_on_exit", "release"]

# Windows has no SIGHUP.
_ENDING = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))

_open: list[Callable[[], None]] = []


def closes_on_exit(close: Callable[[], None]) -> None:
    """Have a function called when the program ends.

    Args:
        close: A bound ``close``; calling it twice does nothing.
    """
    _open.append(close)
    atexit.register(close)
    if threading.current_thread() is threading.main_thread():
        for number in _ENDING:
            if signal.getsignal(number) == signal.SIG_DFL:
                signal.signal(number, _leave)


def release(close: Callable[[], None]) -> None:
    """Take a function back; with the last one, those signals end the program at once again."""
    if close not in _open:
        return
    _open.remove(close)
    atexit.unregister(close)
    if not _open and threading.current_thread() is threading.main_thread():
        for number in _ENDING:
            if signal.getsignal(number) is _leave:
                signal.signal(number, signal.SIG_DFL)


def _leave(number: int, _frame: FrameType | None) -> None:
    raise SystemExit(128 + number)
