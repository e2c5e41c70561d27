"""A hand's path through the whole chain of the arm onto the simulated arm, and how well it is followed.

``python -m tega.sim.arm_path`` prints the table of ``docs/arm.md``; with a recording (``hand.csv``) it takes that
instead of the path made up here. Everything it prints is simulated.
"""

from __future__ import annotations

import sys
from bisect import bisect_right
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.arm import ArmChain, ArmSettings, FilterSettings, LimitSettings, MappingSettings, Pose, StampedPose
from tega.arm.rotation import IDENTITY, between, exp, from_matrix, inverse, multiply, to_matrix
from tega.arm.sources import RecordedPoses, ScriptedPoses, Waypoint, path_through, read_poses

__all__ = ["CASES", "Case", "Followed", "follow_path", "hand_path", "tracked"]

_TICK_NS = 9_000_000  # three ticks of the hand's loop: 111 Hz
_START_NS = 1_000_000_000
_NOISE_M, _NOISE_RAD = 1e-3, 2e-3
_TREMOR_M, _TREMOR_HZ = 3e-4, 9.0
_REST_S = 0.3
_MOST_LAG_S = 0.6

# The workspace around the bench's grasp poses, world frame; the bench's fingers point along x, as the cone has it.
_BOX = LimitSettings(low_m=(-0.45, -0.55, 0.05), high_m=(0.20, 0.15, 0.60))


class Case(NamedTuple):
    """A way to run the chain.

    Attributes:
        name: What is different in it.
        settings: The chain's; ``None`` leads the arm by the tracked poses as they come.
        delay_ms: The poses arrive so late.
    """

    name: str
    settings: ArmSettings | None
    delay_ms: int = 0


class Followed(NamedTuple):
    """How a path was followed by the palm.

    Attributes:
        error_mm: Distance from where the hand was at the same time, root mean square.
        worst_mm: The distance that 95 of 100 do not exceed.
        lag_ms: The shift in time that makes the distance smallest.
        shape_mm: Distance that is left then, root mean square.
        turn_mrad: Angle from how the hand was turned, at the same shift, root mean square.
        jitter_mm: Deviation of the palm while the hand rests, root mean square.
        following: Share of the time in which the chain followed.
    """

    error_mm: float
    worst_mm: float
    lag_ms: float
    shape_mm: float
    turn_mrad: float
    jitter_mm: float
    following: float


def _chain(*, ahead: bool = True, smooth: bool = True, speed_m_s: float = 0.25) -> ArmSettings:
    limits = msgspec.structs.replace(_BOX, speed_m_s=speed_m_s)
    if not ahead:
        limits = msgspec.structs.replace(limits, ahead_m=10.0, ahead_rad=3.0)
    return ArmSettings(mapping=MappingSettings(frame="base"), limits=limits, filter=FilterSettings(on=smooth))


CASES: tuple[Case, ...] = (
    Case("no chain: every pose as it comes", None),
    Case("default", _chain()),
    Case("without filter", _chain(smooth=False)),
    Case("without clip", _chain(ahead=False)),
    Case("without filter and clip", _chain(smooth=False, ahead=False)),
    Case("poses 20 ms late", _chain(), 20),
    Case("poses 50 ms late", _chain(), 50),
    Case("poses 80 ms late", _chain(), 80),
    Case("poses 120 ms late", _chain(), 120),
)
"""The rows of the table."""


def hand_path() -> tuple[Callable[[float], Pose], float]:
    """Return a path of a forearm that reaches, lifts by 0.2 m, carries and puts down, and how long it takes."""
    waypoints, t_s = [Waypoint(0.0, Pose(np.zeros(3), IDENTITY))], 0.0
    moves = (
        (0.6, (0, 0, 0), (0, 0, 0)),
        (1.2, (0.08, 0.04, 0.0), (0, 0, 0.15)),
        (0.6, (0.08, 0.04, 0.0), (0, 0, 0.15)),
        (1.6, (0.08, 0.04, 0.2), (0.1, -0.1, 0.15)),
        (0.6, (0.08, 0.04, 0.2), (0.1, -0.1, 0.15)),
        (1.4, (-0.10, -0.06, 0.2), (0, 0.2, -0.2)),
        (1.6, (-0.10, -0.06, 0.0), (0, 0, -0.2)),
        (0.8, (-0.10, -0.06, 0.0), (0, 0, -0.2)),
    )
    for dt_s, place, turn in moves:
        t_s += dt_s
        waypoints.append(Waypoint(t_s, Pose(np.array(place, np.float64), exp(np.array(turn, np.float64)))))
    return path_through(waypoints), t_s


def tracked(path: Callable[[float], Pose], duration_s: float, *, seed: int) -> list[StampedPose]:
    """Return what a tracker of 60 Hz makes of a path: tremor of 0.3 mm at 9 Hz, noise of 1 mm and 2 mrad."""
    phases = 2 * np.pi * np.random.default_rng(seed).random(3)

    def shaken(t_s: float) -> Pose:
        place, q = path(t_s)
        return Pose(place + _TREMOR_M * np.sin(2 * np.pi * _TREMOR_HZ * t_s + phases), q)

    source = ScriptedPoses(shaken, noise_m=_NOISE_M, noise_rad=_NOISE_RAD, seed=seed)
    source.read(0)
    return list(source.read(round(duration_s * 1e9)))


def follow_path(
    case: Case, poses: Sequence[StampedPose], path: Callable[[float], Pose], duration_s: float
) -> Followed:
    """Lead the simulated arm along a path.

    Args:
        case: How.
        poses: What the tracker saw, in the bench's axes.
        path: Where the hand was, of seconds since the first pose.
        duration_s: How long.

    Raises:
        MissingExtraError: mujoco-core is not installed.
    """
    from tega.sim.world import FULL_DUTY_NM, World, hand_controller

    world, controller = World("bottle", seed=0), hand_controller()
    source = RecordedPoses(poses, delay_ns=case.delay_ms * 1_000_000)
    chain = None if case.settings is None else ArmChain(case.settings)
    start_m, start_turn = world.palm_pose
    start = Pose(start_m, from_matrix(start_turn))
    palms, times, n_following = [], [], 0
    for number in range(round(duration_s * 1e9 / _TICK_NS)):
        after_ns = number * _TICK_NS
        new = source.read(_START_NS + after_ns)
        if chain is not None:
            palm_m, turn = world.palm_pose
            command = chain.step(
                _START_NS + after_ns,
                new,
                clutch=number > 1,
                dead_man=True,
                measured=StampedPose(_START_NS + after_ns, palm_m, from_matrix(turn)),
            )
            n_following += command.state == "following"
            if command.target is not None:
                world.set_palm(command.target.position_m, to_matrix(command.target.quaternion_xyzw))
        elif new:
            q = multiply(np.asarray(new[-1].quaternion_xyzw), start.quaternion_xyzw)
            world.set_palm(start_m + np.asarray(new[-1].position_m), to_matrix(q))
        for hand_tick in range(3):
            world.set_torques(FULL_DUTY_NM * controller.step(world.angles_rad, 1))
            world.advance_to((after_ns + (hand_tick + 1) * _TICK_NS / 3) / 1e9)
        palm_m, turn = world.palm_pose
        palms.append(Pose(palm_m, from_matrix(turn)))
        times.append((after_ns + _TICK_NS) / 1e9)
    return _judge(np.array(times), palms, path, start, n_following / len(times))


def _judge(
    times: NDArray[np.float64],
    palms: Sequence[Pose],
    path: Callable[[float], Pose],
    start: Pose,
    following: float,
) -> Followed:
    places = np.array([palm.position_m for palm in palms])
    wanted = {
        ms: np.array([start.position_m + path(t - ms / 1e3).position_m for t in times])
        for ms in range(0, round(1e3 * _MOST_LAG_S), 5)
    }
    away = {ms: np.linalg.norm(places - at, axis=1) for ms, at in wanted.items()}
    lag_ms = min(away, key=lambda ms: _rms(away[ms]))
    turns = [
        np.linalg.norm(
            between(
                multiply(path(t - lag_ms / 1e3).quaternion_xyzw, start.quaternion_xyzw), palm.quaternion_xyzw
            )
        )
        for t, palm in zip(times, palms, strict=True)
    ]
    # At rest: the hand has not moved for a while, long enough for the arm to be there.
    still = [np.linalg.norm(b - a) < 1e-9 for a, b in pairwise(wanted[0])] + [False]
    settled = round(1e9 * _REST_S / _TICK_NS)
    rests = [i for i in range(settled, len(still)) if all(still[i - settled : i + 1])]
    runs = np.split(np.array(rests), 1 + np.flatnonzero(np.diff(rests) > 1)) if rests else []
    jitter = [places[run] - places[run].mean(axis=0) for run in runs if len(run) > 5]
    return Followed(
        1e3 * _rms(away[0]),
        1e3 * float(np.percentile(away[0], 95)),
        float(lag_ms),
        1e3 * _rms(away[lag_ms]),
        1e3 * _rms(np.array(turns)),
        1e3 * _rms(np.linalg.norm(np.concatenate(jitter), axis=1)) if jitter else float("nan"),
        following,
    )


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _as_recorded(poses: Sequence[StampedPose]) -> Callable[[float], Pose]:
    """Return a recording as a path that begins at no displacement: the newest pose at each time."""
    times = [(pose.t_ns - poses[0].t_ns) / 1e9 for pose in poses]
    first_m, back = np.array(poses[0].position_m), inverse(np.array(poses[0].quaternion_xyzw))

    def path(t_s: float) -> Pose:
        at = poses[max(0, bisect_right(times, t_s) - 1)]
        return Pose(np.array(at.position_m) - first_m, multiply(np.array(at.quaternion_xyzw), back))

    return path


def main(words: Sequence[str]) -> None:
    """Print the table, in Markdown."""
    if words:
        poses = read_poses(Path(words[0]))
        path, duration_s = _as_recorded(poses), (poses[-1].t_ns - poses[0].t_ns) / 1e9
    else:
        path, duration_s = hand_path()
        poses = tracked(path, duration_s, seed=1)
    lines = ["| | error mm | 95 of 100 mm | lag ms | shape mm | turn mrad | jitter mm | following |"]
    lines.append("|---|---|---|---|---|---|---|---|")
    for case in CASES:
        f = follow_path(case, poses, path, duration_s)
        share = "–" if case.settings is None else f"{100 * f.following:.0f} %"
        if case.settings is not None and not f.following:
            lines.append(f"| {case.name} | – | – | – | – | – | – | 0 %: the arm stays |")
            continue
        lines.append(
            f"| {case.name} | {f.error_mm:.1f} | {f.worst_mm:.1f} | {f.lag_ms:.0f} | {f.shape_mm:.1f} | "
            f"{f.turn_mrad:.0f} | {f.jitter_mm:.2f} | {share} |"
        )
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
