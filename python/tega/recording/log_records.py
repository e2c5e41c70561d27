"""Record the program's own log lines."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable

from tega.records import LogLine


class LogRecords(logging.Handler):
    """Makes a record of each line of the log; ``start_ns`` is the monotonic clock at the session's start."""

    def __init__(self, put: Callable[[LogLine], object]) -> None:
        super().__init__(logging.INFO)
        self._put = put
        # A logger with this handler only would no longer warn people where nobody has set logging up.
        self._last = None if logging.getLogger("tega").hasHandlers() else logging.lastResort
        self.start_ns = 0

    def emit(self, record: logging.LogRecord) -> None:
        """Hand a line over."""
        t_ns = time.monotonic_ns() - self.start_ns
        if self._last is not None and record.levelno >= self._last.level:
            self._last.handle(record)
        self._put(LogLine(t_ns=t_ns, level=record.levelno, name=record.name, text=record.getMessage()))
