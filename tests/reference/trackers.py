"""What the tests of trackers share: reading until there is enough, an arm that is led."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any, Protocol

from tega.arm import ArmChain, ArmCommand, StampedPose
from tega.devices import Tracker


class LiveTracker(Tracker, Protocol):
    """A tracker that counts what came."""

    counts: Any


def until(tracker: LiveTracker, enough: Callable[[list[StampedPose]], bool]) -> list[StampedPose]:
    poses: list[StampedPose] = []
    # Counted, not timed: a machine that stands still for a while is no failure.
    for _ in range(5000):
        if enough(poses):
            return poses
        poses += tracker.read(time.monotonic_ns())
        time.sleep(0.002)
    raise AssertionError((tracker.problem, tracker.counts, poses[-3:]))


def some(tracker: LiveTracker, *, valid: bool = True) -> list[StampedPose]:
    """Read on until ten poses in a row are so."""
    return until(tracker, lambda poses: len(poses) >= 10 and all(p.valid == valid for p in poses[-10:]))[-10:]


class Steered:
    """The chain on a tracker's poses, with an arm that is where it is told to be."""

    def __init__(self, tracker: Tracker) -> None:
        self.tracker = tracker
        self.chain = ArmChain()
        self.at = StampedPose(0, (0.5, 0.0, 0.3), (0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5)))
        self.reasons: list[str] = []

    def until(self, enough: Callable[[ArmCommand], bool], *, clutch: bool = True) -> ArmCommand:
        for _ in range(6000):
            now_ns = time.monotonic_ns()
            command = self.chain.step(
                now_ns,
                self.tracker.read(now_ns),
                clutch=clutch,
                dead_man=True,
                measured=self.at._replace(t_ns=now_ns),
            )
            if command.target is not None:
                self.at = StampedPose(now_ns, command.target.position_m, command.target.quaternion_xyzw)
            if command.reason not in self.reasons[-1:]:
                self.reasons.append(command.reason)
            if enough(command):
                return command
            time.sleep(0.01)
        raise AssertionError((command.state, command.reason, self.tracker.problem))

    def hold(self) -> None:
        self.until(lambda c: c.reason == "the clutch is open", clutch=False)
        self.until(lambda c: c.state == "following")

    def travel_m(self, start: StampedPose) -> float:
        return math.dist(list(start.position_m), list(self.at.position_m))
