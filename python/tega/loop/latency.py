"""Measure how old each vest frame's camera frames and each hand command's EMG sample are, stage by stage.

========  ==============================================================================================
stage     from - to
========  ==============================================================================================
touch, of each camera frame that changes what the vest is sent
camera    the picture's capture stamp - our program has it in hand
contact   - its contact is measured
wait      - the loop makes a vest frame of it
map       - the vest frame is made
held      - the greatest rate of the vest's link lets it go
hand-over - its bytes are handed to the transport
own       contact, map and hand-over together: what we do, without what is waited for
in-hand   all from having it in hand to the hand-over, every wait included; for this there is a budget
whole     camera to hand-over
skin      whole and the motor's onset, where that was measured: the middle of the bursts, added to every figure
intent, of each block of EMG when it first steers the hand
sample    the newest sample's stamp - our program has it
levels    - the block's levels are known
wait      - the loop commands the hand
report    - the hand reports its joints, every 3 ms on its own clock; torques answer a report
hand-over - its first torques are handed to the transport
own       levels and hand-over together
whole     sample to hand-over
motion, of each block of EMG that first asks a resting hand for another closure
sample, levels, wait as above
joint     the hand was commanded - a joint moved in the positions that it reports
whole     sample to that motion
========  ==============================================================================================
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, Final

from tega.config.person import MotorOnset
from tega.devices.base import StampingVest
from tega.loop.inbox.histogram import LEAST_SAMPLES, Histogram
from tega.loop.joint_motion import JointMotion
from tega.records.bus import Bus
from tega.records.run import INTENT_STAGES, MOTION_STAGES, TOUCH_STAGES, Latency

__all__ = ["INTENT_STAGES", "MOTION_STAGES", "SKIN", "TOUCH_STAGES", "LatencyTrace"]

SKIN: Final = "skin"
"""The stage that the motor's onset is part of; there is none where that was not measured."""

_LIVE_NS: Final = 5_000_000_000
_REPORT_NS: Final = 1_000_000_000
_PENDING: Final = 64


class LatencyTrace:
    """Follows frames and blocks through the loop, and publishes each that has arrived; nothing in it waits or grows.

    ``now_ns`` returns the time since the start of the session, at which the monotonic clock shows ``start_ns``. The
    budgets are for the p99 within five seconds: ``budget_ms`` of touch ``in-hand``, or ``own`` if the vest is refreshed
    at a ``steady`` pace; ``joint_budget_ms`` of the muscles' way to a joint's first motion. ``answered_ns`` returns
    when a hand's torques first left at or after a monotonic time, and when the report that they answer arrived.

    Attributes:
        warning: The path that is over budget now, and its slowest stage; ``""`` for none.
        last_warning: The newest that was not ``""``.
        n_replaced: Camera frames that would have changed the vest, but were replaced by a newer one of the
            finger before the vest's link was free; they are in no percentile.
        line: Latency in one line, p50 and p99 of the whole run; updated once a second.
    """

    def __init__(
        self,
        *,
        now_ns: Callable[[], int],
        start_ns: int,
        budget_ms: float,
        joint_budget_ms: float = 300.0,
        steady: bool = False,
        vests: Sequence[StampingVest] = (),
        answered_ns: Callable[[int], tuple[int, int] | None] | None = None,
        joints: JointMotion | None = None,
        motor: MotorOnset | None = None,
        bus: Bus | None = None,
    ) -> None:
        self.motor, self.now_ns, self._start_ns = motor, now_ns, start_ns
        self._budget_ns, self._joint_budget_ns = budget_ms * 1e6, joint_budget_ms * 1e6
        self._limited = "own" if steady else "in-hand"
        self._vests, self._answered_ns, self._joints = vests, answered_ns, joints
        self._coming: dict[str, deque[tuple[int, int, int]]] = {}
        self._fresh: dict[str, tuple[int, int, int]] = {}
        self._offered: dict[str, tuple[int, int]] = {}
        self.n_replaced = 0
        self._ticks: dict[int, dict[str, tuple[int, ...]]] = {}
        self._felt: dict[str, int] = {}
        self._block: tuple[int, ...] | None = None
        self._asking: tuple[int, ...] | None = None
        self.spreads = _spreads(touch=TOUCH_STAGES, intent=INTENT_STAGES, motion=MOTION_STAGES)
        self._live = _spreads(touch=TOUCH_STAGES, motion=MOTION_STAGES)
        self._live_until_ns = _LIVE_NS
        self._bus = Bus() if bus is None else bus
        self.warning = self.last_warning = self.line = ""
        self._reported_ns = 0

    def source(self, name: str) -> Callable[[int, int], None]:
        """Return the function that a source's thread calls with an item's stamp and the monotonic time of receipt."""
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
                self._offered.pop(name, None)
                if name == "emg":
                    self._asking = item
                return

    def vest(self, tick_ns: int, began_ns: int, made_ns: int, *, changed: bool) -> None:
        """Note that a vest frame was made; if no vest shows it (``changed``), its camera frames do not count."""
        fresh = {name: item for name, item in self._fresh.items() if name != "emg"}
        if fresh and changed:
            # What waits in the driver and is sent with a newer frame has been made with the older one.
            self._ticks[tick_ns] = {
                name: (*item, *self._offered.setdefault(name, (began_ns, made_ns)))
                for name, item in fresh.items()
            }
            if len(self._ticks) > _PENDING:
                del self._ticks[next(iter(self._ticks))]
            if not self._vests:
                self._displayed(tick_ns, 0, self.now_ns())
        elif fresh:
            # It changes nothing, unless it was offered before and is on its way.
            for name in fresh.keys() - self._offered.keys():
                del self._fresh[name]
        for vest in self._vests:
            for written_ns, free_ns, at_ns in vest.handed_over():
                self._displayed(written_ns, free_ns - self._start_ns, at_ns - self._start_ns)
        if made_ns >= self._reported_ns + _REPORT_NS:
            self._reported_ns = made_ns
            self.line = self._text()
        if made_ns >= self._live_until_ns:
            ours = ["contact", "map", "hand-over"] + (["wait", "held"] if self._limited == "in-hand" else [])
            found = (
                self._over("touch", self._limited, self._budget_ns, "our part of camera to vest", ours),
                self._over("motion", "whole", self._joint_budget_ns, "muscle to joint", MOTION_STAGES[:-1]),
            )
            self.warning = "; ".join(filter(None, found))
            self.last_warning = self.warning or self.last_warning
            self._live = _spreads(touch=TOUCH_STAGES, motion=MOTION_STAGES)
            self._live_until_ns = made_ns + _LIVE_NS

    @property
    def n_unmoved(self) -> int:
        """New closures after which no joint of the hand moved for a second; they are in no percentile."""
        return 0 if self._joints is None else self._joints.n_unmoved

    def commanded(self, level: float | None) -> None:
        """Note the commanded level, ``None`` if not the muscles'; look for the one before and for a motion."""
        if self._joints is not None:
            moved = self._joints.check(self.now_ns(), level, self._asking)
            if moved is not None:
                self._arrived("motion", "emg", moved)
        if self._answered_ns is None:
            return
        if self._block is not None:
            reported_ns = self._block[-1] + self._start_ns
            if (answer := self._answered_ns(reported_ns)) is not None:
                # A report that was in already when the hand was commanded was not waited for.
                stamps_ns = (max(answer[0], reported_ns) - self._start_ns, answer[1] - self._start_ns)
                self._arrived("intent", "emg", (*self._block, *stamps_ns))
                self._block = None
        if self._block is None and (block := self._fresh.pop("emg", None)) is not None:
            self._block = (*block, self.now_ns())

    def _text(self) -> str:
        parts = []
        for path, subject, ours in (
            ("touch", "camera to vest", self._limited),
            ("intent", "muscle to hand", "own"),
            ("motion", "muscle to joint", ""),
        ):
            whole = self.spreads[path]["whole"]
            if 0 < whole.n < LEAST_SAMPLES:
                parts.append(f"{subject} {whole.worst_ns / 1e6:.0f} ms at most (n {whole.n})")
            elif whole.n:
                parts.append(
                    f"{subject} {whole.at(0.5) / 1e6:.0f} ms, p99 {whole.at(0.99) / 1e6:.0f} (n {whole.n})"
                )
                if ours:
                    own = self.spreads[path][ours]
                    parts[-1] += f" (ours {own.at(0.5) / 1e6:.1f}, p99 {own.at(0.99) / 1e6:.1f})"
                if path == "touch" and self.motor is not None:
                    parts[-1] += f", to the skin {whole.at(0.5) / 1e6 + self.motor.ms:.0f}"
        return " · ".join(parts)

    def summary(self) -> dict[str, Any]:
        """Return count and percentiles of every stage, milliseconds, by path; paths with nothing are left out."""
        found = {
            path: {stage: spread.summary_ms() for stage, spread in stages.items()}
            for path, stages in self.spreads.items()
            if stages["whole"].n
        }
        if self.motor is not None and "touch" in found:
            whole, ms = found["touch"]["whole"], self.motor.ms
            found["touch"][SKIN] = {name: v if name == "n" else round(v + ms, 3) for name, v in whole.items()}
        return found

    def _displayed(self, tick_ns: int, free_ns: int, handed_ns: int) -> None:
        displayed = self._ticks.pop(tick_ns, {})
        replaced = set()
        for older_ns in sorted((t_ns for t_ns in self._ticks if t_ns < tick_ns), reverse=True):
            for name, item in self._ticks.pop(older_ns).items():
                # What never left by itself has left with this frame, unless the finger has a newer picture in it.
                if displayed.setdefault(name, item)[0] != item[0] != self._felt.get(name):
                    replaced.add((name, item[0]))
        self.n_replaced += len(replaced)
        for name, item in displayed.items():
            if (newest := self._fresh.get(name)) is not None and newest[0] == item[0]:
                del self._fresh[name]
                self._offered.pop(name, None)
            # A frame that went out with two vest frames was felt with the first.
            if self._felt.get(name) == item[0]:
                continue
            self._felt[name] = item[0]
            self._arrived("touch", name, (*item, max(item[-1], free_ns), handed_ns))

    def _arrived(self, path: str, source: str, stamps_ns: tuple[int, ...]) -> None:
        route = Latency(path=path, source=source, stamps_ns=stamps_ns)
        live = self._live.get(path)
        for stage, ns in route.stages_ns().items():
            self.spreads[path][stage].add(ns)
            if live is not None:
                live[stage].add(ns)
        self._bus.publish(route)

    def _over(self, path: str, limited: str, budget_ns: float, subject: str, stages: Sequence[str]) -> str:
        """Say by how much the newest five seconds of a path are over their budget; ``""`` if they are not."""
        live = self._live[path]
        spread = live[limited]
        if not spread.n or spread.at(0.99) <= budget_ns:
            return ""
        worst = max(stages, key=lambda stage: live[stage].at(0.99))
        ms = f"{spread.at(0.99) / 1e6:.{1 if path == 'touch' else 0}f}"
        figure = "p99" if spread.n >= LEAST_SAMPLES else "worst"
        return (
            f"latency: {subject} takes {ms} ms ({figure} of {spread.n}), {budget_ns / 1e6:g} ms are allowed; "
            f"most in {worst!r}"
        )


def _spreads(**paths: Sequence[str]) -> dict[str, dict[str, Histogram]]:
    return {path: {stage: Histogram() for stage in stages} for path, stages in paths.items()}
