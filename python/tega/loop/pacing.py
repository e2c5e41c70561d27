"""Pace a loop by deadlines counted from the start, so that a late tick does not push the ones after it.

Python's collector of cyclic garbage must not hold up a run either: every thread waits 15 to 30 ms for a full round.
"""

from __future__ import annotations

import gc
from bisect import bisect_left
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final, Literal

import msgspec

from tega.devices.base import DeviceInfo
from tega.errors import ConfigError
from tega.runtime.clock import Clock
from tega.runtime.threads import Bell

# A tick this late is made up for; beyond it, a burst of old commands would do more harm than a gap.
CATCH_UP_NS = 100_000_000
_HANGS_NS = 1_000_000_000
# A tick later than this, one of the hand, is an overrun.
_OVERRUN_NS = 3_000_000


LATE_EDGES_NS: Final = tuple(round(1e6 * edge_ms) for edge_ms in (0.1, 0.2, 0.5, 1, 2, 3, 5, 10, 20, 50, 100))
"""Upper bounds of the bins in which late ticks are counted, nanoseconds; one more bin counts later ones."""


class Pacer:
    """Waits for absolute deadlines on a clock; with a manual clock it never sleeps.

    Attributes:
        bell: Ends a wait early when rung; ``None`` if only deadlines count.
        tick_ns: The turn of the loop: the deadline last waited for, or when it was woken since.
        n_waits: Deadlines waited for, with those left out, ``n_skipped``, since the loop was more than 100 ms late.
        n_overruns: Deadlines that were more than one hand tick (3 ms) late.
        n_late: Number of late deadlines in each bin of :data:`LATE_EDGES_NS`.
    """

    def __init__(self, clock: Clock, *, bell: Bell | None = None) -> None:
        self._clock = clock
        self.bell = bell
        self.start_ns = clock.now_ns()
        self.n_ticks = self.n_overruns = self.n_skipped = self.worst_ns = 0
        self.n_late = [0] * (len(LATE_EDGES_NS) + 1)
        self.late_ns = self.tick_ns = self.n_waits = 0

    def start(self) -> int:
        """Begin counting now, and return the clock's time of this moment in nanoseconds."""
        self.start_ns = self._clock.now_ns()
        return self.start_ns

    def elapsed_ns(self) -> int:
        """Return the time since the start."""
        return self._clock.now_ns() - self.start_ns

    @property
    def hangs(self) -> bool:
        """Whether the loop has come to no tick for a second; asked in another thread."""
        return self.elapsed_ns() - self.tick_ns > _HANGS_NS

    def doze(self, t_ns: int) -> int:
        """Wait for a deadline, or until something comes before it; return the time then, else the deadline."""
        if self.bell is None or not self.bell.wait((t_ns - self.elapsed_ns()) * 1e-9):
            return t_ns
        now_ns = self.elapsed_ns()
        if now_ns < t_ns:
            self.tick_ns = now_ns
            return now_ns
        # Too late to be early. What has come may be newer than the deadline, and is looked for again after it.
        self.bell.ring()
        return t_ns

    def wait(self, t_ns: int) -> bool:
        """Wait for a deadline; false when it is too late for the tick to make sense."""
        self._clock.sleep_until(self.start_ns + t_ns)
        self.tick_ns = t_ns
        self.n_waits += 1
        self.late_ns = late_ns = self.elapsed_ns() - t_ns
        self.n_late[bisect_left(LATE_EDGES_NS, late_ns)] += 1
        self.worst_ns = max(self.worst_ns, late_ns)
        if late_ns > CATCH_UP_NS:
            self.n_skipped += 1
            return False
        self.n_ticks += 1
        self.n_overruns += late_ns > _OVERRUN_NS
        return True


def refuse_live(info: DeviceInfo, pace: Literal["fast", "real"]) -> None:
    """Refuse a live device where the run does not wait for real time (pace ``fast``)."""
    if pace == "fast" and info.live:
        raise ConfigError(f"session.pace = 'fast', but {info.label} is live", "set session.pace = 'real'")


class LoopReport(msgspec.Struct, kw_only=True):
    """Counts, times and ends of a loop.

    Attributes:
        end_ns: Time at which it ended.
        ended: ``complete``, ``duration`` (the set time was over), ``stopped`` (asked to) or ``failed``.
        n_contacts: Frames taken in, by finger.
        n_blocks: EMG blocks taken in.
        n_hand_ticks: Ticks of the hand.
        n_vest_ticks: Ticks of the vest, each a frame for every sink that takes them all.
        n_vest_between: Frames between the ticks, each since a picture changed something.
        n_stale_ticks: Vest frames in which a finger was silent for want of a fresh frame, by finger.
        level_ticks: Hand ticks spent on each level, 1 to 5.
    """

    end_ns: int = 0
    ended: str = "failed"
    n_contacts: dict[str, int] = {}
    n_blocks: int = 0
    n_hand_ticks: int = 0
    n_vest_ticks: int = 0
    n_vest_between: int = 0
    n_stale_ticks: dict[str, int] = {}
    level_ticks: dict[int, int] = {}


def settle() -> None:
    """Exclude all current objects from garbage collection from now on."""
    gc.freeze()
    # Of next to nothing; the collector counts from here on, so that its full rounds are many and short.
    gc.collect()


@contextmanager
def settled() -> Iterator[None]:
    """Exclude current objects, and those at each :func:`settle`, from garbage collection within this block."""
    settle()
    try:
        yield
    finally:
        gc.unfreeze()
