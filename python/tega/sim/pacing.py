"""The loop's deadlines where the world is simulated: waiting for one makes the world go on until then."""

from __future__ import annotations

import time
from collections.abc import Callable

from tega.clock import Clock
from tega.teleop.pacing import Pacer

__all__ = ["SimulatedPacer"]

_PAUSE_LOOK_S = 0.02


class SimulatedPacer(Pacer):
    """Waits for a deadline on the clock, then lets simulated time pass up to it.

    No tick is left out. A loop that falls more than 100 ms behind, or was paused, shifts the deadlines that are
    left instead: the simulation runs late then, and its results are the same at every pace.

    Args:
        clock: A manual clock to run as fast as can be computed, the machine's to run in real time.
        advance: Makes the simulated world go on until a time in nanoseconds.
        paused: Asked before every tick; nothing moves while it says so.
    """

    def __init__(
        self,
        clock: Clock,
        advance: Callable[[int], None],
        *,
        paused: Callable[[], bool] = lambda: False,
    ) -> None:
        super().__init__(clock)
        self._advance = advance
        self._paused = paused

    def wait(self, t_ns: int) -> bool:
        """Wait for a deadline and let the world catch up with it.

        Args:
            t_ns: The deadline, counted from the start.

        Returns:
            Always true.
        """
        if self._paused():
            while self._paused():
                time.sleep(_PAUSE_LOOK_S)
            self._start_ns = self._clock.now_ns() - t_ns
        if not super().wait(t_ns):
            self._start_ns += self.elapsed_ns() - t_ns
        self._advance(t_ns)
        return True
