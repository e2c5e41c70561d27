"""A hand's path through the whole chain of the arm onto the simulated arm: pick and place, and how well it is followed.

It holds the default chain's figures of ``docs/evidence/arm.md``. Everything here is simulated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.arm import (
    ArmChain,
    ArmSettings,
    GateSettings,
    LimitSettings,
    MappingSettings,
    Pose,
    StampedPose,
)
from tega.arm.frames import ToBase
from tega.arm.rotation import IDENTITY, between, exp, from_matrix, inverse, multiply, to_matrix
from tega.devices.tracker.sources import RecordedPoses, read_poses
from tega_emulators.scripted_poses import ScriptedPoses, Waypoint, path_through

_TICK_NS = 9_000_000  # three ticks of the hand's loop: 111 Hz
_START_NS = 1_000_000_000
_NOISE_M, _NOISE_RAD = 1e-3, 2e-3
_TREMOR_M, _TREMOR_HZ = 3e-4, 9.0
_MOST_LAG_S = 0.9

# The workspace around the bench's grasp poses, world frame; the bench's fingers point along x, as the cone has it.
_SETTINGS = ArmSettings(
    gate=GateSettings(age_ms=100.0),
    mapping=MappingSettings(frame="base"),
    limits=LimitSettings(low_m=(-0.45, -0.55, 0.05), high_m=(0.20, 0.15, 0.60)),
)

_OBJECT = "container"
_GRIP_LEVEL = 4
_BACK_M = 0.12
# From where the hand waits to the object: 30° from straight out of the palm, as the bench's own lifts come to it.
_REACH = _BACK_M * np.array([0.5, 0.75**0.5, 0.0])
_CARRY = np.array([-0.12, -0.06, 0.0])
_LIFT = np.array([0.0, 0.0, 0.2])
# Placed: it stands, and so near to the mark.
_NEAR_M, _UPRIGHT = 0.03, math.cos(math.radians(10))


class HandPath(NamedTuple):
    """Where a forearm goes, and what the hand does on the way.

    ``at`` is where it is, of seconds since the beginning: displacement and turn from there. ``closed_s`` is
    from when to when the hand is asked to grip.
    """

    at: Callable[[float], Pose]
    duration_s: float
    closed_s: tuple[float, float]


class Placed(NamedTuple):
    """What became of the object.

    ``off_mm`` is how far along the table it is at the end from where a hand that follows exactly would put
    it; ``placed``: it was lifted by 10 cm and stands within 3 cm of there.
    """

    lifted_m: float
    off_mm: float
    placed: bool


class Followed(NamedTuple):
    """How a path was followed by the palm.

    Attributes:
        shape_mm: Distance from where the hand was, at the shift in time that makes it smallest, root mean square.
        turn_mrad: Angle from how the hand was turned, at the same shift, root mean square.
        following: Share of the time in which the chain followed.
        placed: What became of the object.
    """

    shape_mm: float
    turn_mrad: float
    following: float
    placed: Placed


def hand_path() -> HandPath:
    """Return a path that reaches for the bench's object, lifts it by 0.2 m, carries it, puts it down and lets go."""
    there = _REACH + _CARRY
    turned, tilted = (0.0, 0.0, 0.2), (0.1, -0.1, 0.1)
    moves: tuple[tuple[float, NDArray[np.float64], tuple[float, float, float]], ...] = (
        (0.6, np.zeros(3), (0, 0, 0)),
        (1.2, _REACH, (0, 0, 0)),
        (2.8, _REACH, (0, 0, 0)),  # grips
        (1.6, _REACH + _LIFT, (0, 0, 0)),
        (0.6, _REACH + _LIFT, (0, 0, 0)),
        (0.8, _REACH + _LIFT + _CARRY / 2, tilted),
        (0.8, there + _LIFT, turned),
        (0.6, there + _LIFT, turned),
        (1.6, there, turned),
        (2.2, there, turned),  # lets go
        (1.2, there - _REACH, turned),
        (0.8, there - _REACH, turned),
    )
    waypoints, t_s = [Waypoint(0.0, Pose(np.zeros(3), IDENTITY))], 0.0
    for dt_s, place, turn in moves:
        t_s += dt_s
        waypoints.append(Waypoint(t_s, Pose(place, exp(np.array(turn, np.float64)))))
    grips_s, lets_go_s = waypoints[2].t_s + 0.7, waypoints[9].t_s + 0.7
    return HandPath(path_through(waypoints), t_s, (grips_s, lets_go_s))


def tracked(path: Callable[[float], Pose], duration_s: float, *, seed: int) -> list[StampedPose]:
    """Return what a tracker of 60 Hz makes of a path: tremor of 0.3 mm at 9 Hz, noise of 1 mm and 2 mrad."""
    phases = 2 * np.pi * np.random.default_rng(seed).random(3)

    def shaken(t_s: float) -> Pose:
        place, q = path(t_s)
        return Pose(place + _TREMOR_M * np.sin(2 * np.pi * _TREMOR_HZ * t_s + phases), q)

    source = ScriptedPoses(shaken, noise_m=_NOISE_M, noise_rad=_NOISE_RAD, seed=seed)
    source.read(0)
    return list(source.read(round(duration_s * 1e9)))


def follow_path(poses: Sequence[StampedPose], path: HandPath) -> Followed:
    """Lead the simulated arm along a path by the default chain.

    ``poses`` are what the tracker saw, in the bench's axes; ``path`` is where the hand was from then on.
    """
    from tega_sim.world import FULL_DUTY_NM, World, hand_controller

    world, controller = World(_OBJECT, seed=0, start_m=(0.0, _BACK_M)), hand_controller()
    source, chain = RecordedPoses(poses), ArmChain(_SETTINGS)
    start_m, start_turn = world.palm_pose
    stood_m, _ = world.object_pose
    palms, times, n_following, lifted_m = [], [], 0, 0.0
    for number in range(round(path.duration_s * 1e9 / _TICK_NS)):
        after_ns = number * _TICK_NS
        palm_m, turn = world.palm_pose
        command = chain.step(
            _START_NS + after_ns,
            source.read(_START_NS + after_ns),
            clutch=number > 1,
            dead_man=True,
            measured=StampedPose(_START_NS + after_ns, palm_m, from_matrix(turn)),
        )
        n_following += command.state == "following"
        if command.target is not None:
            world.set_palm(command.target.position_m, to_matrix(command.target.quaternion_xyzw))
        # What a person's muscles would ask for, here by the time alone.
        level = _GRIP_LEVEL if path.closed_s[0] <= after_ns / 1e9 < path.closed_s[1] else 1
        for hand_tick in range(3):
            world.set_torques(FULL_DUTY_NM * controller.step(world.angles_rad, level))
            world.advance_to((after_ns + (hand_tick + 1) * _TICK_NS / 3) / 1e9)
        palm_m, turn = world.palm_pose
        palms.append(Pose(palm_m, from_matrix(turn)))
        times.append((after_ns + _TICK_NS) / 1e9)
        lifted_m = max(lifted_m, float(world.object_pose[0][2] - stood_m[2]))
    pick, put = map(path.at, path.closed_s)
    turned = to_matrix(multiply(put.quaternion_xyzw, inverse(pick.quaternion_xyzw)))
    mark = start_m + put.position_m + turned @ (stood_m - start_m - pick.position_m)
    now_m, axis = world.object_pose
    off_m = math.hypot(*(now_m - mark)[:2].tolist())
    stands = abs(now_m[2] - stood_m[2]) < _NEAR_M and axis[2] > _UPRIGHT
    placed = Placed(lifted_m, 1e3 * off_m, bool(stands and lifted_m > 0.1 and off_m < _NEAR_M))
    places = np.array([palm.position_m for palm in palms])
    away = {
        ms: np.linalg.norm(
            places - np.array([start_m + path.at(t - ms / 1e3).position_m for t in times]), axis=1
        )
        for ms in range(0, round(1e3 * _MOST_LAG_S), 5)
    }
    lag_ms = min(away, key=lambda ms: _rms(away[ms]))
    start_q = from_matrix(start_turn)
    turns = [
        np.linalg.norm(
            between(multiply(path.at(t - lag_ms / 1e3).quaternion_xyzw, start_q), palm.quaternion_xyzw)
        )
        for t, palm in zip(times, palms, strict=True)
    ]
    return Followed(1e3 * _rms(away[lag_ms]), 1e3 * _rms(np.array(turns)), n_following / len(times), placed)


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2)))


def hand_of(path: Path) -> list[StampedPose]:
    """Return the forearm's path of a CSV file, or of a session recorded with an arm, in the base's axes."""
    if path.suffix == ".csv":
        return read_poses(path)
    from tega.recording.mcap_folder import session_files
    from tega.recording.poses_file import forearm

    mapping, poses = forearm(session_files(path)[0])
    to_base = ToBase(mapping)
    return [pose._replace(**to_base(pose)._asdict()) if pose.valid else pose for pose in poses]
