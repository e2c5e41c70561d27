"""The arm's chain in use, on a hand that can be moved or an arm in a process of its own."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from tega.arm import (
    ArmChain,
    ArmCommand,
    ArmSettings,
    LimitSettings,
    MappingSettings,
    Pose,
    PoseSource,
    StampedPose,
)
from tega.arm import rotation as so3
from tega.devices.base import TellingArm

MS = 1_000_000

MIDDLE = np.array([0.5, 0.0, 0.3])

FORWARD = so3.exp(np.array([0, math.pi / 2, 0]))


class Bench:
    """A chain in use: a hand that can be moved, an arm that goes where it is asked or stays."""

    def __init__(self, limits: LimitSettings | None = None, **mapping: Any) -> None:
        self.limits = limits or LimitSettings(ahead_m=10, ahead_rad=3)
        self.chain = ArmChain(
            ArmSettings(mapping=MappingSettings(**{"frame": "base", **mapping}), limits=self.limits)
        )
        self.now_ns, self.hand_m, self.turn = 0, np.zeros(3), so3.IDENTITY
        self.arm = Pose(MIDDLE, FORWARD)
        self.clutch = self.dead_man = self.tracker = self.link = True
        self.stuck = False
        self.source: PoseSource | None = None  # in place of the hand

    def go(
        self, ms: int, *, dt_ms: int = 10, valid: bool = True, move: tuple[float, ...] = (0, 0, 0)
    ) -> ArmCommand:
        """Go on for a time; ``move`` is the hand's way over all of it."""
        n = ms // dt_ms
        for _ in range(n):
            self.now_ns += dt_ms * MS
            self.hand_m = self.hand_m + np.array(move) / n
            hand = [StampedPose(self.now_ns, self.hand_m, self.turn, valid)] if self.tracker else []
            self.last = self.chain.step(
                self.now_ns,
                hand if self.source is None else self.source.read(self.now_ns),
                clutch=self.clutch,
                dead_man=self.dead_man,
                measured=StampedPose(self.now_ns, *self.arm) if self.link else None,
            )
            self.arm = self.arm if self.stuck else self.last.target or self.arm
        return self.last

    def take_hold(self) -> Bench:
        self.clutch = False
        self.go(20)
        self.clutch = True
        assert self.go(20).state == "following", self.last.reason
        return self

    @property
    def away_m(self) -> list[float]:
        return [round(x, 4) for x in (self.arm.position_m - MIDDLE).tolist()]


class Led:
    """The chain and an arm, at about 100 Hz; the forearm is where the test puts it."""

    def __init__(self, arm: TellingArm, settings: ArmSettings | None = None) -> None:
        self.arm = arm
        self.chain = ArmChain(settings or ArmSettings(mapping=MappingSettings(frame="base")))
        self.forearm = np.zeros(3)
        self.command: ArmCommand | None = None

    def until(self, enough: Callable[[], object], *, clutch: bool = True) -> None:
        # Counted, not timed: a machine that stands still for a while is no failure.
        for _ in range(1500):
            if enough():
                return
            now_ns = time.monotonic_ns()
            poses = [StampedPose(now_ns, self.forearm.tolist(), (0.0, 0.0, 0.0, 1.0))]
            self.command = self.chain.step(
                now_ns, poses, clutch=clutch, dead_man=True, measured=self.arm.measured()
            )
            self.arm.follow(self.command)
            time.sleep(0.01)
        raise AssertionError((self.command, self.arm.phase, self.arm.problem, self.arm.measured()))

    def go_on(self, turns: int, *, clutch: bool = True) -> None:
        done = iter(range(turns))
        self.until(lambda: next(done, None) is None, clutch=clutch)

    def hold(self) -> None:
        self.until(lambda: self.said("the clutch is open"), clutch=False)
        self.until(lambda: self.arm.phase == "following")

    def said(self, reason: str) -> bool:
        return self.command is not None and self.command.reason == reason

    @property
    def place(self) -> np.ndarray:
        pose = self.arm.measured()
        assert pose is not None
        return np.array(pose.position_m)
