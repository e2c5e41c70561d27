"""Wake the loop when a frame has come, so that the loop need not wait for the next tick."""

from __future__ import annotations

import contextlib
import threading


class Bell:
    """Rung by the sources' threads to wake the loop; several rings before the loop wakes count once."""

    def __init__(self) -> None:
        # A lock that is held while nothing has happened: the one thing Python waits for without code of its own.
        self._silent = threading.Lock()
        self._silent.acquire()

    def ring(self) -> None:
        """Wake the waiting thread, or the next one that waits."""
        with contextlib.suppress(RuntimeError):  # rung already
            self._silent.release()

    def wait(self, timeout_s: float) -> bool:
        """Wait for a ring; without time left none is looked for."""
        return timeout_s > 0 and self._silent.acquire(timeout=timeout_s)
