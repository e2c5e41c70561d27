"""Move arm and hand to their start between trials: through the chain of every motion, while the dead-man is held."""

from __future__ import annotations

import time
from contextlib import ExitStack
from typing import Final

import msgspec
import numpy as np

from tega.arm.move_to_start import SPEED_M_S, TURN_RAD_S, MoveToStart
from tega.arm.pose import Pose
from tega.arm.settings import FilterSettings, MappingSettings
from tega.config import SessionConfig
from tega.config.sections import ArmConfig
from tega.devices.base import SteeredHand, WatchedHand, optional
from tega.devices.registry import driver_class
from tega.errors import ConfigError
from tega.hand import CLOSURE_POSES_RAD
from tega.hand.poses import ClosureScale, load_poses
from tega.loop.arm import open_arm
from tega.loop.sinks import open_inputs
from tega.records import ArmTurn
from tega.records.bus import Bus
from tega.runtime.guide import Shows

WARNING_S: Final = 3.0
"""Time for which a motion is announced before anything may move."""
PATIENCE_S: Final = 30.0
"""So long the dead-man is waited for."""
OPEN_RAD: Final = 0.2
"""Largest distance of any joint from the open pose for a hand to count as open."""
_LEVELS_PER_S = 2.0
_POLL_S = 0.02
# The arm itself comes after its target: it rests once its place has changed by no more for so long, or after a while.
_SETTLE_S, _STILL_M, _LONGEST_S = 1.0, 0.0005, 5.0
# What leads the arm reports its state a hundred times a second; a hand is opened by nothing older.
_FRESH_S = 0.2


class Settling:
    """Detects when an arm has come to rest, allowing for its steady lag behind the target."""

    def __init__(self) -> None:
        self._there_s: float | None = None
        self._still_s = self._off_m = 0.0

    def rests(self, now_s: float, *, there: bool, off_m: float) -> bool:
        """Update with whether the target is at its goal and the arm's distance from it, metres; true at rest."""
        if not there:
            self._there_s = None
            return False
        if self._there_s is None:
            self._there_s, self._still_s, self._off_m = now_s, now_s, off_m
        if abs(off_m - self._off_m) > _STILL_M:
            self._still_s, self._off_m = now_s, off_m
        return now_s - self._still_s >= _SETTLE_S or now_s - self._there_s >= _LONGEST_S


def go_to_start(
    config: SessionConfig, shows: Shows, *, reported_s: float = WARNING_S, bus: Bus | None = None
) -> str:
    """Move the arm to ``arm.start_m`` and open the hand, then let go of both; return what is left, in words.

    The motion is announced first. Nothing moves before ``reported_s`` are over, while the dead-man (and the
    clutch, if there is one) is not held, or while no process guards the hand. The arm is bound by its
    workspace, clip, limits and watchdogs, and moves at 0.1 m/s at most. Every turn of it is published on
    ``bus``; an exception that ``shows`` raises ends the motion. The words are the distance of the arm from
    its start, and of the hand from its open pose.

    Raises:
        ConfigError: The settings have no arm with a start, or something that the arm needs is missing.
        DeviceUnavailableError: A device is missing, went away or is at fault.
        TimeoutError: The dead-man was not held for :data:`PATIENCE_S`.
    """
    arm = config.arm
    if arm is None or (start := arm.start) is None:
        raise ConfigError("the arm has no start to go to", "set arm.start_m")
    config = _unsteered(config, arm)
    with ExitStack() as stack:
        route = MoveToStart(start)
        bus = Bus() if bus is None else bus
        bus.subscribe(ArmTurn, route.saw, vital=True)
        steering = open_arm(stack, config, open_inputs(stack, config), tracker=route)
        hand = _Opening(stack, config)
        warned_until_s = time.monotonic() + reported_s
        steering.start(
            bus,
            time.monotonic_ns(),
            may_move=lambda: time.monotonic() >= warned_until_s and not hand.unguarded,
        )
        stack.callback(steering.stop)
        last_s = held_s = time.monotonic()
        settling = Settling()
        while True:
            now_s = time.monotonic()
            follows = route.state == "following" and now_s - route.seen_s < _FRESH_S
            held_s = now_s if follows else max(held_s, warned_until_s)
            if now_s - held_s > PATIENCE_S:
                raise TimeoutError(f"the dead-man switch was not held for {PATIENCE_S:g} s: {route.reason}")
            if now_s < warned_until_s:
                shows.show("THE ARM WILL MOVE: everybody out of its reach", (), warned_until_s - now_s)
            elif problem := steering.problem or hand.unguarded:
                shows.show(problem, (), None)
            elif follows:
                left_m = route.left_m or 0.0
                shows.show(f"the arm moves to its start: {100 * left_m:.0f} cm to go", (), None)
            else:
                shows.show(
                    f"hold the dead-man switch, and the arm moves to its start ({route.reason})", (), None
                )
            hand.check(now_s - last_s, may_move=follows and not hand.unguarded)
            last_s = now_s
            if settling.rests(
                now_s, there=follows and route.there and hand.is_open, off_m=route.off_m or 0.0
            ):
                break
            time.sleep(_POLL_S)
        return f"the arm is at its start, {1000 * (route.off_m or 0.0):.0f} mm off" + hand.words


def watch_arm(config: SessionConfig, arm: ArmConfig, seconds: float, *, bus: Bus) -> None:
    """Open the arm of the settings and watch it for a while; nothing may move.

    ``DeviceUnavailableError`` where a device is missing, went away or is at fault.
    """
    config = _unsteered(config, arm)
    with ExitStack() as stack:
        nowhere = MoveToStart(Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])))
        steering = open_arm(stack, config, open_inputs(stack, config), tracker=nowhere)
        steering.start(bus, time.monotonic_ns(), may_move=lambda: False)
        stack.callback(steering.stop)
        time.sleep(seconds)


def _unsteered(config: SessionConfig, arm: ArmConfig) -> SessionConfig:
    """Return the settings for a way that is given in the base's own axes, no faster than such a way may be."""
    replace, speed_m_s, turn_rad_s = msgspec.structs.replace, arm.limits.speed_m_s, arm.limits.turn_rad_s
    limits = replace(arm.limits, speed_m_s=min(speed_m_s, SPEED_M_S), turn_rad_s=min(turn_rad_s, TURN_RAD_S))
    mapping = MappingSettings(frame="base", mirror=False)
    arm = replace(arm, mapping=mapping, filter=FilterSettings(on=False), limits=limits)
    return replace(config, arm=arm, session=replace(config.session, pace="real"))


class _Opening:
    """The hand of the settings, opened level by level while things may move; it keeps its pose meanwhile."""

    def __init__(self, stack: ExitStack, config: SessionConfig) -> None:
        self._hand: SteeredHand | None = None
        self._level: float | None = None
        if config.hand.driver is not None:
            options = config.hand.options
            made = driver_class(config.hand.driver, "hand")(options)
            poses = getattr(options, "poses", None)
            poses_rad = CLOSURE_POSES_RAD if poses is None else load_poses(poses)
            self._closure, self._open_rad = ClosureScale(poses_rad), poses_rad[0]
            if isinstance(made, SteeredHand):
                self._hand = stack.enter_context(made)
                if isinstance(made, WatchedHand):
                    made.watched = True

    @property
    def is_open(self) -> bool:
        """Whether the hand was sent its most open pose, or there is no hand."""
        return self._hand is None or self._level == 1.0

    @property
    def unguarded(self) -> str:
        """Reason why the hand would not be released if this program were killed now; ``""`` if it would be."""
        return "" if self._hand is None else str(optional(self._hand, "guard_problem"))

    @property
    def words(self) -> str:
        """Result in words, by the joint angles that the hand reports."""
        if self._hand is None:
            return ""
        off_rad = float(np.abs(self._hand.angles_rad - self._open_rad).max())
        if off_rad <= OPEN_RAD:
            return f"; the hand is open, {off_rad:.2f} rad off"
        return f"; the hand was commanded to open and is {off_rad:.2f} rad off"

    def check(self, dt_s: float, *, may_move: bool) -> None:
        hand = self._hand
        if hand is None:
            return
        if may_move:
            before = self._closure(np.asarray(hand.angles_rad)) if self._level is None else self._level
            self._level = max(1.0, before - _LEVELS_PER_S * dt_s)
        if self._level is not None:
            hand.step(self._level)
