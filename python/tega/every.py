"""Call a function every so many seconds in a thread of its own, while a block runs."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def every(action: Callable[[], object], *, every_s: float, name: str) -> Iterator[None]:
    """Call a function at once, and again after each rest, in a thread of its own; the block ends after the last call.

    Args:
        action: Called again and again.
        every_s: The rest between the end of a call and the next call.
        name: Of the thread.
    """
    over = threading.Event()

    def run() -> None:
        while True:
            action()
            if over.wait(every_s):
                return

    thread = threading.Thread(target=run, name=name, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
