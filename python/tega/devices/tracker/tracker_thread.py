"""Collect a tracker's poses from a thread of its own, and end the thread."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence
from typing import ClassVar, Final

from tega.arm.pose import StampedPose
from tega.devices.base import Kind
from tega.errors import DeviceUnavailableError
from tega.runtime.lifecycle import Opened

_MOST_POSES: Final = 256


class ThreadedTracker(Opened):
    """A tracker that a driver's ``open`` starts a thread for, which puts poses into ``_poses`` under ``_lock``.

    The thread stops once ``_leaving`` is set; it reports to the operator with ``_say``.

    Attributes:
        driver: Its name among drivers.
        leave_s: How long the thread may take to leave.
    """

    kind: ClassVar[Kind] = "tracker"
    driver: ClassVar[str]
    leave_s: ClassVar[float] = 5.0

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._leaving = threading.Event()
        self._thread: threading.Thread | None = None
        self._poses: deque[StampedPose] = deque(maxlen=_MOST_POSES)
        self._trouble = ""

    def close(self) -> None:
        """End the thread, and with it the connection."""
        thread, self._thread = self._thread, None
        if thread is not None:
            self._leave(thread)

    def read(self, now_ns: int) -> Sequence[StampedPose]:  # noqa: ARG002  # poses carry their own times
        """Return the poses that came since the last call, oldest first; never waits.

        Args:
            now_ns: The time on the monotonic clock.

        Raises:
            DeviceUnavailableError: It is not open.
        """
        if self._thread is None:
            raise DeviceUnavailableError(f"{self.driver}: it is not open", "use it in a with block")
        with self._lock:
            poses = list(self._poses)
            self._poses.clear()
        return poses

    def _leave(self, thread: threading.Thread) -> None:
        self._leaving.set()
        thread.join(self.leave_s)

    def _say(self, trouble: str) -> None:
        with self._lock:
            self._trouble = trouble
