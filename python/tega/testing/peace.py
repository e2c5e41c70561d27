"""Trials whose times are not spoilt by a machine that stood still."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TypeVar

from tega.errors import TegaError

__all__ = ["in_peace"]

# Held up for longer than this, a time that was measured is the machine's, not that of what is tried.
_STOOD_STILL_S = 0.5
_ATTEMPTS = 4

Found = TypeVar("Found")


def in_peace(trial: Callable[[], Found]) -> Found:
    """Run a trial; again if this machine stood still meanwhile, and the last time whatever it did."""
    for left in reversed(range(_ATTEMPTS)):
        over, longest_s = threading.Event(), 0.0

        def watch(over: threading.Event = over) -> None:
            nonlocal longest_s
            last_s = time.monotonic()
            while not over.wait(0.02):
                now_s = time.monotonic()
                longest_s, last_s = max(longest_s, now_s - last_s), now_s

        watching = threading.Thread(target=watch, daemon=True)
        watching.start()
        try:
            found = trial()
        except TegaError:
            if longest_s < _STOOD_STILL_S or not left:
                raise
            continue
        finally:
            over.set()
            watching.join()
        if longest_s < _STOOD_STILL_S:
            break
    return found
