"""Drain a device in a thread of its own, and open it again when it goes away."""

from __future__ import annotations

import threading
from typing import Any, ClassVar

from tega.runtime.lifecycle import Opened
from tega.runtime.reopening import Reopening


class Drained(Opened):
    """A driver whose thread takes all that a device sends, so that what it gives is the newest.

    Attributes:
        back_off_s: Shortest and longest pause before a device that went away is tried again.
        leave_s: How long closing waits for the thread.
    """

    back_off_s: ClassVar[tuple[float, float]] = (0.25, 2.0)
    leave_s: ClassVar[float] = 5.0

    def __init__(self) -> None:
        self._leaving = threading.Event()
        self._thread: threading.Thread | None = None
        self._trouble = ""

    def _connect(self) -> Any:
        """Open the device."""
        raise NotImplementedError

    def _drain(self, link: Any) -> bool:
        """Take what comes until the device fails or ``_leaving`` is set; return whether anything came."""
        raise NotImplementedError

    def _disconnect(self, link: Any) -> None:
        link.close()

    def _refused(self, error: Exception) -> None:
        self._trouble = f": {getattr(error, 'message', error)}"

    def _begin(self, link: Any, name: str) -> None:
        """Start the thread with an open device."""
        self._leaving.clear()
        self._thread = threading.Thread(target=self._run, args=(link,), name=name, daemon=True)
        self._thread.start()

    def _run(self, link: Any) -> None:
        Reopening(*self.back_off_s).serve(
            link, self._connect, self._drain, self._disconnect, self._leaving.wait, refused=self._refused
        )

    def close(self) -> None:
        """Stop the thread and let the device go."""
        thread, self._thread = self._thread, None
        self._leaving.set()
        if thread is not None:
            thread.join(self.leave_s)
