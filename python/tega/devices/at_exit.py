"""Close devices when the program ends: on exit, and on a request to terminate.

A ``with`` block closes its devices when it is left, also by an exception. Two cases bypass it: a program without the
``with`` block, and SIGTERM, which ends Python at once unless it is handled. While a device is registered here,
``close`` is called when the interpreter exits, and SIGTERM or SIGHUP (the terminal is closed) raises ``SystemExit``
in the main thread, unless the program has its own handler. A second signal, which a log-out sends right after the
first, does not interrupt the closing. Nothing runs on SIGKILL or a power cut.
"""

from __future__ import annotations

import atexit
import logging
import signal
import sys
import threading
from collections.abc import Callable
from types import FrameType

# Windows has no SIGHUP.
_ENDING = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))

_open: list[Callable[[], None]] = []
_leaving = threading.Event()
_words: list[str] = []


def last_words(text: str) -> None:
    """Print something that a person has to do now, and repeat it as the program's last output."""
    logging.getLogger(__name__).critical(text)
    if not _words:
        atexit.register(_print_words)
    _words.append(text)


def _print_words() -> None:
    for text in dict.fromkeys(_words):
        print(text, file=sys.stderr, flush=True)  # noqa: T201  # there is nothing left that could report it


def closes_on_exit(close: Callable[[], None]) -> None:
    """Have a bound ``close`` called when the program ends; calling it twice must do nothing."""
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
        _leaving.clear()


def _leave(number: int, _frame: FrameType | None) -> None:
    if _leaving.is_set():
        return
    _leaving.set()
    raise SystemExit(128 + number)
