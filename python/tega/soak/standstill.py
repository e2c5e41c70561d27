"""Notices when this whole machine stood still, as when another program was given all of it."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from types import TracebackType
from typing import Self

__all__ = ["Standstills", "within_ns"]

_STEP_S = 0.02
_LEAST_S = 0.25


def within_ns(found: Sequence[tuple[int, int]], since_ns: int, till_ns: int) -> int:
    """Return how much of the time between two moments lies within those found."""
    return sum(max(0, min(till, till_ns) - max(since, since_ns)) for since, till in found)


class Standstills:
    """A thread that does nothing but look how late it wakes."""

    def __init__(self) -> None:
        self._found: list[tuple[int, int]] = []
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> Self:
        """Begin to look."""
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Look no more."""
        self._over.set()
        self._thread.join()

    @property
    def total_s(self) -> float:
        """How long it stood still in all, seconds."""
        return sum(till - since for since, till in self._found) / 1e9

    def within_ns(self, since_ns: int, till_ns: int) -> int:
        """Return for how long it stood still between two times of day, all in ns."""
        return within_ns(self._found, since_ns, till_ns)

    def _watch(self) -> None:
        last_ns = time.time_ns()
        while not self._over.wait(_STEP_S):
            now_ns = time.time_ns()
            if now_ns - last_ns > _LEAST_S * 1e9:
                self._found.append((last_ns, now_ns))
            last_ns = now_ns
