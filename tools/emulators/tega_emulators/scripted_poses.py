"""Sample forearm poses along a path that is computed: for tests, examples and benches."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tega.arm.pose import Pose, StampedPose
from tega.arm.rotation import between, exp, multiply, unit
from tega.errors import InvalidValueError
from tega.records import PoseNumbers


class Waypoint(NamedTuple):
    """A pose that the path comes to, and rests at, at ``t_s``."""

    t_s: float
    pose: Pose


def path_through(waypoints: Sequence[Waypoint]) -> Callable[[float], Pose]:
    """Return the path that goes from waypoint to waypoint by minimum-jerk moves, and rests at both ends.

    The share of the way at the share u of the time is 10 u³ - 15 u⁴ + 6 u⁵; turns go about one axis.
    """
    times = [w.t_s for w in waypoints]
    if not times or any(b <= a for a, b in pairwise(times)):
        raise InvalidValueError(f"times of waypoints are {times} s", "at least one, each later than the last")

    def path(t_s: float) -> Pose:
        number = int(np.searchsorted(times, t_s, side="right"))
        if number == 0 or number == len(times):
            return waypoints[max(number - 1, 0)].pose
        (from_s, one), (to_s, other) = waypoints[number - 1], waypoints[number]
        u = (t_s - from_s) / (to_s - from_s)
        share = u**3 * (10 + u * (6 * u - 15))
        turn = exp(share * between(one.quaternion_xyzw, other.quaternion_xyzw))
        return Pose(
            one.position_m + share * (other.position_m - one.position_m),
            unit(multiply(turn, one.quaternion_xyzw)),
        )

    return path


class ScriptedPoses:
    """Samples a path, of seconds since the first call, as a tracker would, with noise if wanted.

    ``noise_m`` and ``noise_rad`` are standard deviations: of each coordinate, of each component of a small
    turn.
    """

    def __init__(
        self,
        path: Callable[[float], Pose],
        *,
        rate_hz: float = 60.0,
        noise_m: float = 0.0,
        noise_rad: float = 0.0,
        seed: int = 0,
    ) -> None:
        self._path, self._rate_hz = path, rate_hz
        self._noise = (noise_m, noise_rad)
        self._random = np.random.default_rng(seed)
        self._start_ns: int | None = None
        self._next = 0

    def read(self, now_ns: int) -> Sequence[StampedPose]:
        """Return the samples since the last call, each with its own stamp."""
        if self._start_ns is None:
            self._start_ns = now_ns
        poses: list[StampedPose] = []
        while (after_ns := round(self._next * 1e9 / self._rate_hz)) <= now_ns - self._start_ns:
            place, q = self._path(after_ns / 1e9)
            noise_m, noise_rad = self._noise
            place = place + noise_m * self._random.standard_normal(3)
            q = unit(multiply(exp(noise_rad * self._random.standard_normal(3)), q))
            poses.append(StampedPose(self._start_ns + after_ns, place, q))
            self._next += 1
        return poses


def write_poses(path: Path, poses: Iterable[StampedPose]) -> None:
    """Write poses so that :func:`tega.devices.tracker.sources.read_poses` gives back the same numbers.

    Times are kept to a nanosecond.
    """
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["t_s", *PoseNumbers.table, "valid"])
        for pose in poses:
            numbers = [float(x) for x in (*pose.position_m, *pose.quaternion_xyzw)]
            writer.writerow([f"{pose.t_ns / 1e9:.9f}", *map(repr, numbers), int(pose.valid)])
