"""Keep Python's collector of cyclic garbage from holding up a run.

A full collection looks at every object of the program, of which imports alone leave some 100,000: every thread, the
hand's among them, waits 15 to 30 ms for it, and much longer where another program takes the core meanwhile.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


def settle() -> None:
    """Exclude all current objects from garbage collection from now on."""
    gc.freeze()
    # Of next to nothing; the collector counts from here on, so that its full rounds are many and short.
    gc.collect()


@contextmanager
def settled() -> Iterator[None]:
    """Exclude current objects, and those at each :func:`settle`, from garbage collection within this block."""
    settle()
    try:
        yield
    finally:
        gc.unfreeze()
