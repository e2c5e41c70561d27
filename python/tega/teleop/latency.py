"""How old what is felt and done is: every vest frame with its camera frames, every hand command with its EMG sample.

========  ==============================================================================================
stage     from - to
========  ==============================================================================================
touch, of each camera frame when it is first on the vest
camera    the picture's capture stamp - our program has it
contact   - its contact is measured
wait      - the loop makes the next vest frame of it
map       - the vest frame is made
hand-over - its bytes are handed to the transport
own       contact, map and hand-over together: our part, for which there is a budget
whole     camera to hand-over
skin      whole and the motor's onset, where that was measured: the middle of the bursts, added to every figure
intent, of each block of EMG when it first steers the hand
sample    the newest sample's stamp - our program has it
levels    - the block's levels are known
wait      - the loop tells the hand
hand-over - its first torques are handed to the transport
own       levels and hand-over together
whole     sample to hand-over
========  ==============================================================================================
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final, NamedTuple, Protocol

if TYPE_CHECKING:
    from tega.calibration.motor_onset import MotorOnset

__all__ = ["INTENT_STAGES", "SKIN", "TOUCH_STAGES", "FrameLatency", "LatencyTrace", "Spread", "Tells"]

TOUCH_STAGES: Final = ("camera", "contact", "wait", "map", "hand-over", "own", "whole")
INTENT_STAGES: Final = ("sample", "levels", "wait", "hand-over", "own", "whole")

SKIN: Final = "skin"
"""The stage that the motor's onset is part of; there is none where that was not measured."""

_LIVE_NS: Final = 5_000_000_000
_TELL_NS: Final = 1_000_000_000
_PENDING: Final = 64


class Spread:
    """How numbers are spread, in little memory however many: counted in bins a fiftieth wide.

    Percentiles are right within 2 %, the worst is exact.

    Attributes:
        n: How many.
        worst_ns: The largest.
    """

    _GROWTH = math.log(1.02)

    def __init__(self) -> None:
        self._bins: dict[int, int] = {}
        self.n = 0
        self.worst_ns = 0

    def add(self, ns: int) -> None:
        """Take one; what is below a microsecond counts as that."""
        k = int(math.log(max(ns, 1000)) / self._GROWTH)
        self._bins[k] = self._bins.get(k, 0) + 1
        self.n += 1
        self.worst_ns = max(self.worst_ns, ns)

    def at(self, share: float) -> float:
        """Return the number that so large a share of all stays at or below, in ns; NaN for none."""
        left = math.ceil(share * self.n)
        for k in sorted(self._bins):
            left -= self._bins[k]
            if left <= 0:
                return min(math.exp((k + 1) * self._GROWTH), float(self.worst_ns))
        return math.nan

    def summary_ms(self) -> dict[str, float | int]:
        """Return count, p50, p95, p99 and worst, milliseconds."""
        shares = {"p50": 0.5, "p95": 0.95, "p99": 0.99}
        found = {name: round(self.at(share) / 1e6, 3) for name, share in shares.items() if self.n}
        return {"n": self.n, **found, "worst": round(self.worst_ns / 1e6, 3)}


class FrameLatency(NamedTuple):
    """The way of one camera frame to the vest, or of one block of EMG to the hand.

    Attributes:
        path: ``touch`` or ``intent``.
        source: The finger, or ``emg``.
        stamps_ns: Times since the start of the session: captured, received, measured, taken up, (made,) handed over.
    """

    path: str
    source: str
    stamps_ns: tuple[int, ...]

    def stages_ns(self) -> dict[str, int]:
        """Return how long each stage took, by :data:`TOUCH_STAGES` or :data:`INTENT_STAGES`."""
        steps = [later - sooner for sooner, later in pairwise(self.stamps_ns)]
        # The wait for the next tick is the vest's own pace, and the camera's way is not ours.
        own = steps[1] + sum(steps[3:])
        names = TOUCH_STAGES if self.path == "touch" else INTENT_STAGES
        return dict(zip(names, (*steps, own, self.stamps_ns[-1] - self.stamps_ns[0]), strict=True))


class Tells(Protocol):
    """A vest that tells when a frame was handed to its transport."""

    def handed_over(self) -> Sequence[tuple[int, int]]:
        """Return, since the last call, the time each frame was written with and the monotonic time, ns, it left at."""
        ...


class LatencyTrace:
    """Follows frames and blocks through the loop; nothing in it waits or grows.

    Args:
        now_ns: Time since the start of the session.
        start_ns: The monotonic clock's time at that start.
        budget_ms: What ``own`` of touch may take, 99 frames of 100, within five seconds.
        vests: Those that tell what they hand over.
        answered_ns: Tells when a hand's torques first left at or after a monotonic time; ``None`` without such a hand.
        motor: What comes after the hand-over, as it was measured; ``None`` where it was not.

    Attributes:
        observers: Told of every frame and block that has arrived.
        warning: What is over the budget now, and in which stage most of it goes; ``""`` for nothing.
        last_warning: The newest that was not ``""``.
        line: How it stands in one line, p50 and p99 of the whole run; made anew once a second.
    """

    def __init__(
        self,
        *,
        now_ns: Callable[[], int],
        start_ns: int,
        budget_ms: float,
        vests: Sequence[Tells] = (),
        answered_ns: Callable[[int], int | None] | None = None,
        motor: MotorOnset | None = None,
    ) -> None:
        self.motor = motor
        self.now_ns = now_ns
        self._start_ns = start_ns
        self._budget_ns = budget_ms * 1e6
        self._vests = vests
        self._answered_ns = answered_ns
        self._coming: dict[str, deque[tuple[int, int, int]]] = {}
        self._fresh: dict[str, tuple[int, int, int]] = {}
        self._ticks: dict[int, tuple[dict[str, tuple[int, int, int]], int, int]] = {}
        self._felt: dict[str, tuple[int, int, int]] = {}
        self._block: tuple[int, ...] | None = None
        self.spreads = {"touch": _spreads(TOUCH_STAGES), "intent": _spreads(INTENT_STAGES)}
        self._live = _spreads(TOUCH_STAGES)
        self._live_until_ns = _LIVE_NS
        self.observers: list[Callable[[FrameLatency], None]] = []
        self.warning = self.last_warning = self.line = ""
        self._told_ns = 0

    def source(self, name: str) -> Callable[[int, int], None]:
        """Return what a source's thread is to call with an item's stamp and the monotonic time it was received at."""
        coming = self._coming.setdefault(name, deque(maxlen=_PENDING))

        def measured(t_ns: int, received_ns: int) -> None:
            coming.append((t_ns, received_ns - self._start_ns, self.now_ns()))

        return measured

    def taken(self, name: str, t_ns: int) -> None:
        """Note that the loop has taken in an item."""
        coming = self._coming.get(name)
        while coming:
            item = coming.popleft()
            if item[0] == t_ns:
                self._fresh[name] = item
                return

    def vest(self, tick_ns: int, began_ns: int, made_ns: int, *, sent: bool) -> None:
        """Note that a vest frame was made of what is fresh, and collect what the transports have taken.

        Args:
            tick_ns: The time it is written with.
            began_ns: When its making began.
            made_ns: When it was made.
            sent: Whether it went out; a frame that the vest shows already need not.
        """
        fresh = {name: item for name, item in self._fresh.items() if name != "emg"}
        if fresh and sent:
            self._ticks[tick_ns] = (fresh, began_ns, made_ns)
            if len(self._ticks) > _PENDING:
                del self._ticks[next(iter(self._ticks))]
            if not self._vests:
                self._shown(tick_ns, self.now_ns())
        elif fresh:
            for name in fresh:
                del self._fresh[name]
        for vest in self._vests:
            for written_ns, at_ns in vest.handed_over():
                self._shown(written_ns, at_ns - self._start_ns)
        if made_ns >= self._told_ns + _TELL_NS:
            self._told_ns = made_ns
            self.line = self._said()
        if made_ns >= self._live_until_ns:
            self.warning = self._over_budget()
            self.last_warning = self.warning or self.last_warning
            self._live, self._live_until_ns = _spreads(TOUCH_STAGES), made_ns + _LIVE_NS

    def commanded(self) -> None:
        """Note that the hand is told the newest level, and look whether it has sent what it was told before."""
        if self._answered_ns is None:
            return
        if self._block is not None:
            handed_ns = self._answered_ns(self._block[-1] + self._start_ns)
            if handed_ns is not None:
                self._arrived("intent", "emg", (*self._block, handed_ns - self._start_ns))
                self._block = None
        if self._block is None and (block := self._fresh.pop("emg", None)) is not None:
            self._block = (*block, self.now_ns())

    def _said(self) -> str:
        said = []
        for path, what in (("touch", "camera to vest"), ("intent", "muscle to hand")):
            whole, own = self.spreads[path]["whole"], self.spreads[path]["own"]
            if whole.n:
                said.append(
                    f"{what} {whole.at(0.5) / 1e6:.0f} ms, p99 {whole.at(0.99) / 1e6:.0f} "
                    f"(ours {own.at(0.5) / 1e6:.1f}, p99 {own.at(0.99) / 1e6:.1f})"
                )
                if path == "touch" and self.motor is not None:
                    said[-1] += f", to the skin {whole.at(0.5) / 1e6 + self.motor.ms:.0f}"
        return " · ".join(said)

    def summary(self) -> dict[str, Any]:
        """Return count and percentiles of every stage, milliseconds, by path; paths with nothing are left out."""
        found = {
            path: {stage: spread.summary_ms() for stage, spread in stages.items()}
            for path, stages in self.spreads.items()
            if stages["whole"].n
        }
        if self.motor is not None and "touch" in found:
            found["touch"][SKIN] = self.motor.skin_ms(found["touch"]["whole"])
        return found

    def _shown(self, tick_ns: int, handed_ns: int) -> None:
        found = self._ticks.pop(tick_ns, None)
        if found is None:
            return
        fresh, began_ns, made_ns = found
        for name, item in fresh.items():
            if self._fresh.get(name) == item:
                del self._fresh[name]
            # A frame that went out with two vest frames was felt with the first.
            if self._felt.get(name) == item:
                continue
            self._felt[name] = item
            self._arrived("touch", name, (*item, began_ns, made_ns, handed_ns))

    def _arrived(self, path: str, source: str, stamps_ns: tuple[int, ...]) -> None:
        way = FrameLatency(path, source, stamps_ns)
        live = self._live if path == "touch" else None
        for stage, ns in way.stages_ns().items():
            self.spreads[path][stage].add(ns)
            if live is not None:
                live[stage].add(ns)
        for observer in self.observers:
            observer(way)

    def _over_budget(self) -> str:
        own = self._live["own"]
        if not own.n or own.at(0.99) <= self._budget_ns:
            return ""
        worst = max(("contact", "map", "hand-over"), key=lambda stage: self._live[stage].at(0.99))
        return (
            f"latency: our part of camera to vest takes {own.at(0.99) / 1e6:.1f} ms (p99), "
            f"{self._budget_ns / 1e6:g} ms are allowed; most in {worst!r}"
        )


def _spreads(stages: Sequence[str]) -> Mapping[str, Spread]:
    return {stage: Spread() for stage in stages}
