"""Lead an arm to its start pose: up, over, down, as an operator's forearm would lead it through the arm's chain."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from typing import ClassVar, Final

import numpy as np

from tega.arm.pose import Pose, StampedPose
from tega.arm.rotation import Floats, between, exp, multiply, size, unit
from tega.records import ArmTurn
from tega.runtime.device_items import DeviceInfo, Kind, Options
from tega.runtime.lifecycle import Opened

SPEED_M_S: Final = 0.1
TURN_RAD_S: Final = 0.5
"""A path without an operator is slower than a steered one."""

_NEAR_M, _NEAR_RAD = 0.005, 0.03
_THERE_M, _THERE_RAD, _RESTS_M_S = 0.002, 0.01, 0.005
# What the target is behind grows no further: an arm that was held back does not catch up.
_AHEAD_M, _AHEAD_RAD = 0.02, 0.1
# Share of what is left that a turn takes: the target follows a turn or two later.
_SHARE = 0.2
_LONGEST_S = 0.05


class MoveToStart(Opened):
    """Gives poses of a forearm that leads the arm to its start, in the base's axes, unscaled, not mirrored.

    The arm moves only in state ``following``, and its path starts from the target that the chain has actually
    set. So the chain's gate, clutch, dead-man, workspace, clip, limits and watchdogs apply as on any other
    path.

    Attributes:
        state: Newest state of the chain; ``""`` before.
        left_m: How far the target is from the start; ``None`` before it was known.
        off_m: Measured distance of the arm itself from the start; ``None`` before it was known.
        there: Whether the target rests at the start.
        seen_s: When the chain was last seen, on the monotonic clock.
    """

    kind: ClassVar[Kind] = "tracker"
    summary: ClassVar[str] = "the way to the arm's start"
    options_type: ClassVar[type[Options]] = Options
    frame = "base"
    problem = ""

    def __init__(self, start: Pose) -> None:
        self._start = start
        self._place, self._turn = start.position_m.copy(), start.quaternion_xyzw.copy()
        self._target: Pose | None = None
        self._ways: list[Pose] = []
        self._holds = 0
        self._held_from: tuple[Pose, Pose] | None = None
        self._last_ns: int | None = None
        self._rests = True
        self.state = self.reason = ""
        self.left_m: float | None = None
        self.off_m: float | None = None
        self.there = False
        self.seen_s = -math.inf

    @property
    def info(self) -> DeviceInfo:
        """Description of the steering device."""
        return DeviceInfo(
            driver="way-to-start", kind="tracker", label=self.summary, live=True, rate_hz=None, unit="m"
        )

    def open(self) -> None:
        """Open nothing."""

    def close(self) -> None:
        """Close nothing."""

    def saw(self, turn: ArmTurn) -> None:
        """Process the chain's result for the last pose."""
        self.state, self.reason, self.seen_s = turn.state, turn.reason, time.monotonic()
        if turn.measured and len(place := turn.measured[0].position) == 3:
            self.off_m = math.dist(place, self._start.position_m.tolist())
        if len(turn.target) != 7:
            self._target = None
            return
        self._target = target = Pose(np.array(turn.target[:3]), np.array(turn.target[3:]))
        self.left_m = math.dist(turn.target[:3], self._start.position_m.tolist())
        if turn.state == "following" and turn.holds != self._holds:
            self._holds = turn.holds
            self._held_from = Pose(self._place.copy(), self._turn.copy()), target
            self._ways = self._ways_from(target)
        turned = size(between(target.quaternion_xyzw, self._start.quaternion_xyzw))
        self._rests = math.hypot(*turn.velocity[:3]) < _RESTS_M_S
        self.there = self.left_m < _THERE_M and turned < _THERE_RAD and self._rests

    def _ways_from(self, target: Pose) -> list[Pose]:
        """Return where to go one after the other: never down or aside before it is as high as the start."""
        here, start = target.position_m, self._start.position_m
        top_m = max(float(here[2]), float(start[2]))
        up = Pose(np.array([here[0], here[1], top_m]), target.quaternion_xyzw)
        over = Pose(np.array([start[0], start[1], top_m]), self._start.quaternion_xyzw)
        return [up, over, self._start]

    def read(self, now_ns: int) -> Sequence[StampedPose]:
        """Return where the forearm is now."""
        dt_s = 0.0 if self._last_ns is None else min((now_ns - self._last_ns) / 1e9, _LONGEST_S)
        self._last_ns = now_ns
        if self.state == "following" and self._target is not None and self._held_from is not None:
            self._go_on(self._target, self._held_from, dt_s)
        return [StampedPose(now_ns, self._place.copy(), self._turn.copy())]

    def _go_on(self, target: Pose, held_from: tuple[Pose, Pose], dt_s: float) -> None:
        while len(self._ways) > 1 and _is_near(target, self._ways[0]):
            self._ways.pop(0)
        goal, (place, turn) = self._ways[0], held_from[0]
        ahead = (self._place - place) - (target.position_m - held_from[1].position_m)
        if size(ahead) < _AHEAD_M:
            # While the target still goes where the forearm is already, that much is on its way.
            left = goal.position_m - target.position_m - (0.0 if self._rests else ahead)
            self._place = self._place + _step(left, SPEED_M_S * dt_s)
        ahead = between(turn, self._turn) - between(held_from[1].quaternion_xyzw, target.quaternion_xyzw)
        if size(ahead) < _AHEAD_RAD:
            away = between(target.quaternion_xyzw, goal.quaternion_xyzw)
            self._turn = unit(multiply(exp(_step(away, TURN_RAD_S * dt_s)), self._turn))


def _is_near(target: Pose, goal: Pose) -> bool:
    turned = size(between(target.quaternion_xyzw, goal.quaternion_xyzw))
    return size(goal.position_m - target.position_m) < _NEAR_M and turned < _NEAR_RAD


def _step(away: Floats, most: float) -> Floats:
    length = size(away)
    return away * min(_SHARE, most / length) if length > 0 else away
