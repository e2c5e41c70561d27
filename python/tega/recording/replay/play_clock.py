"""Run a clock at the speed at which a session is played, and count how late it is kept."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

_LATE_NS = 3_000_000


class PlayClock:
    """Time of the session: it stands at 0 until the first tick is waited for, then runs at a speed.

    Args:
        speed: Seconds of the session a second; ``None`` for a clock that never sleeps.
        reach: Called with every deadline once it has come, before the loop reads its input.

    Attributes:
        tick_ns: The deadline last waited for.
        n_late: Deadlines that were more than 3 ms late, by the machine's clock.
        worst_late_ns: The latest one, by the machine's clock.
    """

    def __init__(self, speed: float | None, reach: Callable[[int], None] = lambda _t_ns: None) -> None:
        self._speed, self._reach = speed, reach
        self._began_ns: int | None = None
        self.tick_ns = self.n_late = self.worst_late_ns = 0

    def now_ns(self) -> int:
        """Return the time of the session in nanoseconds."""
        if self._speed is None or self._began_ns is None:
            return self.tick_ns
        return math.floor((time.monotonic_ns() - self._began_ns) * self._speed)

    def sleep_until(self, t_ns: int) -> None:
        """Sleep until the session has come to ``t_ns``."""
        self.tick_ns = max(self.tick_ns, t_ns)
        if self._speed is not None:
            self._sleep(t_ns, self._speed)
        self._reach(self.tick_ns)

    def _sleep(self, t_ns: int, speed: float) -> None:
        if self._began_ns is None:
            self._began_ns = time.monotonic_ns()
        due_ns = self._began_ns + math.ceil(t_ns / speed)
        while (left_ns := due_ns - time.monotonic_ns()) > 0:
            time.sleep(left_ns * 1e-9)
        self.n_late += -left_ns > _LATE_NS
        self.worst_late_ns = max(self.worst_late_ns, -left_ns)
