"""Detect that the computer's clock was set."""

from __future__ import annotations

import time

_STEP_NS = 500_000_000
_REPORTED_NS = 5_000_000_000


class ClockStep:
    """Compares the time of day with the run's clock, which is never set."""

    def __init__(self) -> None:
        self._offset_ns = time.time_ns() - time.monotonic_ns()
        self._until_ns = 0
        self._text = ""

    def __call__(self) -> str:
        """Return by how much the time of day jumped, for five seconds from then on; ``""`` else."""
        now_ns = time.monotonic_ns()
        step_ns = time.time_ns() - now_ns - self._offset_ns
        if abs(step_ns) > _STEP_NS:
            self._offset_ns += step_ns
            self._until_ns = now_ns + _REPORTED_NS
            self._text = (
                f"clock: the time of day jumped by {step_ns / 1e9:+.1f} s; this run counts on as before"
            )
        return self._text if now_ns < self._until_ns else ""
