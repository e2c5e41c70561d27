"""Call a function every so many seconds in a thread of its own, while a block runs."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

__all__ = ["every"]


@contextmanager
def every(do: Callable[[], object], *, every_s: float, name: str) -> Iterator[None]:
    """Do something at once, and again after each rest, in a thread of its own; the block's end waits for the last.

    Args:
        do: It.
        every_s: The rest between its end and its next beginning.
        name: Of the thread.
    """
    over = threading.Event()

    def run() -> None:
        while True:
            do()
            if over.wait(every_s):
                return

    thread = threading.Thread(target=run, name=name, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
