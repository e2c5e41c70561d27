"""Latency from muscle to joint, on the emulated hand's node and its driver's conversation, on a clock that is set."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tega.hand import CLOSURE_POSES_RAD, HandController
from tega.hand.link import HandLink, Received
from tega.loop.joint_motion import JointMotion
from tega.loop.latency import MOTION_STAGES, LatencyTrace
from tega.records import Latency
from tega.records.bus import Bus
from tega.runtime.clock import ManualClock
from tega.ui.view.browser.state_html import rates_html
from tega_emulators.allegro import AllegroNode

MS = 1_000_000
SAMPLE_MS = 10


class Bench:
    """A hand, its conversation and the trace; every millisecond is one step, every third a tick of the loop.

    EMG is made up: a block each 10 ms, received 2 ms after its newest sample and measured 1 ms later.
    """

    def __init__(self, *, torque: bool = True, seed: int = 0) -> None:
        self.clock = ManualClock()
        self.node = AllegroNode(seed=seed)
        self.node._angles = CLOSURE_POSES_RAD[0].copy()  # its way there takes seconds
        self.link = HandLink(HandController(), torque=torque)
        self.reported: list[Latency] = []
        bus = Bus()
        bus.subscribe(Latency, self.reported.append)
        self.trace = LatencyTrace(
            now_ns=self.clock.now_ns,
            start_ns=0,
            budget_ms=5.0,
            answered_ns=lambda _since_ns: None,
            joints=JointMotion(self._angles),
            bus=bus,
        )
        self._measured = self.trace.source("emg")
        self._out: list[Any] = []

    def _angles(self) -> Any:
        angles = self.link.angles_rad
        return np.full(16, np.nan) if angles is None else angles

    def run(
        self,
        seconds: float,
        level: Callable[[int], float],
        *,
        requested: Callable[[float], float | None] = lambda level: level,
    ) -> list[tuple[int, Any]]:
        """Go on, and return where the joints really were, each millisecond."""
        truth = []
        for _ in range(round(seconds * 1000)):
            self.clock.sleep_until(self.clock.now_ns() + MS)
            t_ns = self.clock.now_ns()
            t_ms, t_s = t_ns // MS, t_ns / 1e9
            answers = []
            for frame in self._out:
                answers += self.node.receive(frame.id, bytes(frame.data), remote=frame.remote, t_s=t_s)
            received = [Received(can_id, data) for can_id, data in (*answers, *self.node.due(t_s))]
            wanted = level(t_ms)
            self._out = self.link.exchange(received, t_ns, wanted)
            if t_ms % SAMPLE_MS == 3:
                self._measured(t_ns - 3 * MS, t_ns - MS)
                self.trace.taken("emg", t_ns - 3 * MS)
            if t_ms % 3 == 0:
                self.trace.commanded(requested(wanted))
            truth.append((t_ns, np.array(self.node.angles_rad)))
        return truth

    @property
    def motions(self) -> list[Latency]:
        """What was told of motions."""
        return [route for route in self.reported if route.path == "motion"]


@pytest.mark.parametrize("seed", [1])
def test_a_new_closure_is_followed_to_the_joint_that_moves(seed: int) -> None:
    bench = Bench(seed=seed)
    bench.run(1.5, lambda _t: 1.0)
    assert bench.motions == []  # noise alone
    still = np.array(bench.node.angles_rad)
    # The block of 1510 ms is the first that asks for more: it is known at 1513.
    truth = bench.run(0.5, lambda t_ms: 3.0 if t_ms >= 1513 else 1.0)
    (route,) = bench.motions
    moved_ns = next(t_ns for t_ns, angles in truth if np.abs(angles - still).max() > 0.002)
    assert route.stamps_ns[:3] == (1510 * MS, 1512 * MS, 1513 * MS)
    assert route.stamps_ns[3] == 1515 * MS  # the tick after
    # A report and a tick later than the joint; the mean and the threshold are of noisy reports.
    assert abs(route.stamps_ns[4] - moved_ns) <= 12 * MS
    stages = bench.trace.summary()["motion"]
    assert tuple(stages) == MOTION_STAGES
    assert stages["whole"]["n"] == 1
    assert stages["whole"]["worst"] == (route.stamps_ns[4] - 1510 * MS) / MS
    assert sum(stages[name]["worst"] for name in MOTION_STAGES[:-1]) == stages["whole"]["worst"]
    assert bench.trace.n_unmoved == 0
    bench.trace.vest(4000 * MS, 4000 * MS, 4000 * MS, changed=False)
    assert f"muscle to joint {stages['whole']['worst']:.0f} ms" in bench.trace.line
    assert "muscle to joint" in rates_html({"hand": 333.0}, bench.trace.line)


def test_a_hand_that_cannot_move_is_counted_and_in_no_percentile() -> None:
    bench = Bench(torque=False)
    bench.run(1.5, lambda _t: 1.0)
    bench.run(1.1, lambda _t: 3.0)
    assert bench.motions == []
    assert bench.trace.n_unmoved == 1
    assert "motion" not in bench.trace.summary()


def test_what_somebody_else_moves_counts_as_nothing() -> None:
    bench = Bench()
    bench.run(1.5, lambda _t: 1.0)
    bench.node._angles += 0.05  # somebody pushes the fingers
    bench.run(0.5, lambda _t: 1.0)
    bench.run(0.5, lambda _t: 4.0, requested=lambda _level: None)  # a guard closes it
    bench.run(0.5, lambda _t: 1.0, requested=lambda _level: None)
    assert bench.motions == []
    assert bench.trace.n_unmoved == 0


def test_a_closure_that_is_taken_back_or_comes_without_rest_counts_as_nothing() -> None:
    bench = Bench()
    bench.run(1.5, lambda _t: 1.0)
    bench.run(0.5, lambda t_ms: 3.0 if 1513 <= t_ms < 1516 else 1.0)
    assert bench.motions == []
    bench.run(1.2, lambda t_ms: 2.0 + (t_ms // 200) % 2)  # never the same for 0.3 s
    assert len(bench.motions) <= 1  # the first of them, from rest
    assert bench.trace.n_unmoved == 0
