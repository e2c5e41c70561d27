"""Check an arm, and the input devices and trackers that lead one, against their contracts."""

from __future__ import annotations

import time
from functools import partial

import numpy as np

from tega.arm.frames import FRAMES
from tega.arm.pose import ArmCommand, StampedPose
from tega.devices.arm.base import ArmDriver
from tega.devices.base import InputEvent, InputReading, InputSource, Tracker
from tega.errors import DeviceUnavailableError
from tega.setup.contract.rule import refuses, rule

_TRACKED_S, _POLL_S = 3.0, 0.01
_STILL_M = 0.002


def check_input(source: InputSource) -> None:
    """Check an operator's input device."""
    with source:
        for _ in range(100):
            state = source.state()
            rule(type(state) is InputReading and type(state.t_ns) is int, "state gives an InputState")
            rule(len(state.motion) == 6, "motion has six axes")
            rule(all(-1.0 <= share <= 1.0 for share in state.motion), "motion lies within -1 and 1")
            rule(isinstance(state.held, frozenset), "held is a frozenset")
            rule(
                state.live or not (any(state.motion) or state.held),
                "without data nothing moves and nothing is held",
            )
            events = list(source.events())
            rule(all(isinstance(e, InputEvent) for e in events), "events gives InputEvents")
            numbers = [e.seq for e in events]
            rule(numbers == sorted(set(numbers)), "the numbers of events rise")
    refuses(
        source.events,
        DeviceUnavailableError,
        "asking a closed device for events raises DeviceUnavailableError",
    )


def check_tracker(tracker: Tracker, most_items: int) -> None:
    """Check a tracker of the forearm; of a live one so many poses are looked at."""
    rule(tracker.frame in FRAMES, f"frame is one of {', '.join(FRAMES)}")
    poses: list[StampedPose] = []
    with tracker:
        for _ in range(round(_TRACKED_S / _POLL_S)):
            poses += tracker.read(time.monotonic_ns())
            rule(isinstance(tracker.problem, str), "problem is text")
            if len(poses) >= most_items:
                break
            time.sleep(_POLL_S)
    rule(bool(poses), "an open tracker gives poses")
    rule(all(type(p) is StampedPose and type(p.t_ns) is int for p in poses), "poses are StampedPoses")
    rule(all(len(p.position_m) == 3 and len(p.quaternion_xyzw) == 4 for p in poses), "a place and a turn")
    times = [p.t_ns for p in poses]
    rule(times == sorted(times), "t_ns never decreases")


def check_arm(arm: ArmDriver) -> None:
    """Check an arm without taking control of it: it reports its position, and does not move."""
    nothing = np.zeros(3)
    with arm:
        first = last = arm.measured()
        for number in range(round(_TRACKED_S / _POLL_S)):
            command = ArmCommand(time.monotonic_ns(), "idle", "contract", None, nothing, nothing, 0)
            arm.follow(command)
            last = arm.measured()
            first = first or last
            if last is not None and first is not None and number > 50 and last.t_ns > first.t_ns:
                break
            time.sleep(_POLL_S)
        rule(type(last) is StampedPose, "measured gives a StampedPose")
        assert first is not None
        assert last is not None
        rule(last.t_ns > first.t_ns, "an open arm reports new positions")
        moved_m = float(np.linalg.norm(np.subtract(first.position_m, last.position_m)))
        rule(moved_m < _STILL_M, "without a target it stays where it is")
        rule(arm.phase == "ready", "an arm without a command is ready")
        rule(arm.problem == "", "an arm that is well has no problem")
        rule(arm.health.rate_hz > 0, "it says how its loop runs")
    refuses(
        partial(arm.follow, ArmCommand(0, "idle", "contract", None, nothing, nothing, 0)),
        DeviceUnavailableError,
        "leading a closed arm raises DeviceUnavailableError",
    )
