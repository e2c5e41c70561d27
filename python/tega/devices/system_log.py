"""Log to the system which device may still be moving, for processes without a visible output."""

from __future__ import annotations

import os
import sys
import threading
from typing import Final

_OVERDUE_S: Final = 5.0


class Alarm:
    """Writes to the system's log if a device does not confirm in time, and how that ended."""

    def __init__(self, device: str) -> None:
        self._device, self._overdue = device, False
        self._timer = threading.Timer(_OVERDUE_S, self._raise)
        self._timer.daemon = True
        self._timer.start()

    def end(self, why: str) -> None:
        """Take note that nothing more is tried, and why the device has not confirmed; ``""`` if it has."""
        self._timer.cancel()
        if why:
            log_to_system(f"{self._device}: not confirmed to be off ({why}): use its switch")
        elif self._overdue:
            log_to_system(f"{self._device}: the alert is over")

    def _raise(self) -> None:
        self._overdue = True
        log_to_system(
            f"{self._device}: not confirmed to be off after {_OVERDUE_S:g} s: use its switch; "
            f"process {os.getpid()} goes on trying"
        )


def log_to_system(message: str) -> None:
    """Write an alert to the system's log, where the system has one that Python knows."""
    if sys.platform == "win32":
        return
    import syslog

    syslog.openlog("tega", syslog.LOG_PID, syslog.LOG_DAEMON)
    syslog.syslog(syslog.LOG_ALERT, message)
