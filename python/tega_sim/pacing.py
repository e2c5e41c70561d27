"""Advance the simulated world to each deadline that the loop waits for."""

from __future__ import annotations

from collections.abc import Callable

from tega.loop.pacing import Pacer
from tega.runtime.clock import Clock


class SimulatedPacer(Pacer):
    """Waits for a deadline on the clock, then lets simulated time pass up to it.

    No tick is left out. A loop that falls more than 100 ms behind shifts the deadlines that are left instead: the
    simulation runs late then, and its results are the same at every pace.

    Args:
        clock: A manual clock to run as fast as can be computed, the machine's to run in real time; in a pausable one
            the world stands still with it.
        advance: Makes the simulated world go on until a time in nanoseconds.
    """

    def __init__(self, clock: Clock, advance: Callable[[int], None]) -> None:
        super().__init__(clock)
        self._advance = advance

    def wait(self, t_ns: int) -> bool:
        """Wait for a deadline and let the world catch up with it.

        Args:
            t_ns: The deadline, counted from the start.

        Returns:
            Always true.
        """
        if not super().wait(t_ns):
            self.start_ns += self.elapsed_ns() - t_ns
        self._advance(t_ns)
        return True
