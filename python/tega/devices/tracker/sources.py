"""Give forearm poses from a recording, or from a device that gives speeds, such as a SpaceMouse.

All sources meet :class:`~tega.arm.PoseSource`. Those of a device are in the base's axes (``frame = "base"``), those of
a recording in the axes that it was recorded in. A file has a line for each pose:
``t_s,x_m,y_m,z_m,qx,qy,qz,qw`` and, if wanted, ``valid`` (0, 1).
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from tega.arm.pose import StampedPose
from tega.arm.rotation import IDENTITY, exp, multiply, unit
from tega.errors import RecordingError
from tega.records import PoseNumbers
from tega.runtime.device_items import InputReading
from tega.runtime.files.tables.numbers import named_rows

# A pose is reported once in so long at most, as a tracker would; the summing goes on between.
_LEAST_NS: Final = 1_000_000
# After a longer pause the deflection of before is not summed up: nobody knows how long it lasted.
_LONGEST_S: Final = 0.1
# At full deflection, m/s and rad/s.
_SPEEDS: Final = np.array([0.15] * 3 + [0.6] * 3)
_ROOM_M: Final = 50.0  # half of the gate's; beyond, it goes on at the other end and is held again


class RatePoses:
    """Sums up the motion of an input device to the pose of a forearm that is not there.

    ``position += speed · shape(motion) dt`` along the base's axes, and the same for the rotation, with ``shape(u) = u
    |u|²``: fine near rest, full speed at full deflection. While the device says "no data" the pose is not valid, so
    that the chain holds. Such a device needs a dead-man switch (a button held) but no clutch of its own.

    ``state`` returns the device's newest state, such as :meth:`tega.devices.input.spacemouse.SpaceMouse.state`.

    Example:
        >>> still = InputReading(0, True, (0.0,) * 6, frozenset())
        >>> RatePoses(lambda: still).read(0)[0].position_m
        [0.0, 0.0, 0.0]
    """

    frame: Final = "base"

    def __init__(self, state: Callable[[], InputReading]) -> None:
        self._state = state
        self._place, self._turn = np.zeros(3), IDENTITY
        self._last_ns: int | None = None

    def read(self, now_ns: int) -> Sequence[StampedPose]:
        """Return one pose, of now; none within a millisecond of the last."""
        if self._last_ns is not None and now_ns - self._last_ns < _LEAST_NS:
            return ()
        dt_s = 0.0 if self._last_ns is None else (now_ns - self._last_ns) / 1e9
        self._last_ns = now_ns
        state = self._state()
        if state.live and dt_s <= _LONGEST_S:
            motion = np.array(state.motion)
            route = _SPEEDS * motion * np.abs(motion) ** 2 * dt_s
            self._place = (self._place + route[:3] + _ROOM_M) % (2 * _ROOM_M) - _ROOM_M
            self._turn = unit(multiply(exp(route[3:]), self._turn))
        return (StampedPose(now_ns, self._place.tolist(), self._turn.tolist(), valid=state.live),)


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
