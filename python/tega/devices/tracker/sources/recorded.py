"""Read, write and play forearm poses, a line each: ``t_s,x_m,y_m,z_m,qx,qy,qz,qw`` and, if wanted, ``valid`` (0, 1)."""

from __future__ import annotations

import csv
import math
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from pathlib import Path

from tega.arm.pose import StampedPose
from tega.errors import RecordingError
from tega.records import PoseNumbers
from tega.runtime.files.tables.numbers import named_rows

_COLUMNS = ["t_s", *PoseNumbers.table]


def read_poses(path: Path) -> list[StampedPose]:
    """Return the poses of a file; the gate, not the reader, rejects bad poses.

    The columns may stand in any order, separated by commas, semicolons or tabs. ``RecordingError`` names the
    line: a column is missing, a word is not a number, or a time is not finite or earlier than the one before.
    """
    poses: list[StampedPose] = []
    try:
        names, rows = named_rows(path, most_mib=1024)
        if not set(_COLUMNS) <= set(names):
            raise RecordingError(f"{path.name} does not begin with the line {','.join(_COLUMNS)}")
        for line, cells in rows:
            poses.append(_pose(path.name, line, cells, poses))
    except OSError as error:
        raise RecordingError(f"{path.name} cannot be read: {error}") from error
    return poses


def _pose(name: str, line: int, cells: dict[str, str], before: Sequence[StampedPose]) -> StampedPose:
    """Return the pose of a line."""
    try:
        t_s, *numbers = (float(cells[column]) for column in _COLUMNS)
        valid = float(cells["valid"]) == 1 if "valid" in cells else True
    except KeyError as error:
        n_wanted = len(_COLUMNS) + ("valid" in cells)
        raise RecordingError(f"{name}, line {line}: {len(cells)} numbers, not {n_wanted}") from error
    except ValueError as error:
        raise RecordingError(f"{name}, line {line}: {error}") from error
    if not math.isfinite(t_s) or abs(t_s) > 1e9:
        raise RecordingError(f"{name}, line {line}: {t_s} s is no time")
    t_ns = round(t_s * 1e9)
    if before and t_ns < before[-1].t_ns:
        raise RecordingError(f"{name}, line {line}: {t_s} s is earlier than the line before")
    return StampedPose(t_ns, numbers[:3], numbers[3:], valid=valid)


def write_poses(path: Path, poses: Iterable[StampedPose]) -> None:
    """Write poses so that :func:`read_poses` gives back the same numbers; times are kept to a nanosecond."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*_COLUMNS, "valid"])
        for pose in poses:
            numbers = [float(x) for x in (*pose.position_m, *pose.quaternion_xyzw)]
            writer.writerow([f"{pose.t_ns / 1e9:.9f}", *map(repr, numbers), int(pose.valid)])


class RecordedPoses:
    """Plays poses, of which there must be one, at the times of their stamps, the first at the first call."""

    def __init__(self, poses: Sequence[StampedPose], *, delay_ns: int = 0) -> None:
        if not poses:
            raise RecordingError("the recording has no poses")
        self._poses, self._delay_ns = list(poses), delay_ns
        self._stamps = [pose.t_ns - poses[0].t_ns for pose in poses]
        self._next = 0
        self._start_ns: int | None = None

    @property
    def done(self) -> bool:
        """Whether all have been played."""
        return self._next == len(self._poses)

    def read(self, now_ns: int) -> Sequence[StampedPose]:
        """Return the poses that have arrived since the last call."""
        if self._start_ns is None:
            self._start_ns = now_ns
        first = self._next
        self._next = max(first, bisect_right(self._stamps, now_ns - self._start_ns - self._delay_ns))
        return [
            self._poses[i]._replace(t_ns=self._start_ns + self._stamps[i]) for i in range(first, self._next)
        ]
