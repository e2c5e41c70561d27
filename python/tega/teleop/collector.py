"""Keeps Python's collector of cyclic garbage from holding up a run."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["settled"]


@contextmanager
def settled() -> Iterator[None]:
    """Leave what exists now out of all collections within this block.

    A full collection looks at every object of the program, of which imports alone leave some 100,000: every thread, the
    hand's among them, waits 15 to 30 ms for it. What comes into being within the block is collected as ever.
    """
    gc.freeze()
    gc.collect()  # of next to nothing; the collector counts from here on, so that its full rounds are many and short
    try:
        yield
    finally:
        gc.unfreeze()
