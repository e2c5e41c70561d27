"""Lay streams of a run on frames, as features of LeRobot: each frame has the newest value that was known by then."""

from __future__ import annotations

from array import array
from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from operator import attrgetter
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega import records
from tega.hand import JOINT_NAMES, joined_level
from tega.records.arm import PoseNumbers
from tega.records.schema import fields
from tega_lerobot.spool import Spool

ARM_MEASURED, ARM_TARGET = "/arm/measured", "/arm/target"
CLOSURE = ("grasp_level", "closure")
"""Numbers of the hand's part of an action: the nearest level, 1 to 5, and the closure from 0 (open) to 1 (closed).

LeRobot 0.4 cannot train a policy on an action of one number.
"""
ARM_ACTION = tuple(f"arm_target.{name}" for name in PoseNumbers.table)
"""Numbers of the arm's part of an action: where the arm's end is to go, in the base's axes."""

_S = 1_000_000_000
# Items are written so many at a time.
_MOST_HELD = 1 << 11
# What a contact has in units of physics, where its metric gives them.
_MEASURED = tuple(field.name for field in fields(records.Contact) if field.optional and field.unit != "1")


class Column(NamedTuple):
    """One feature of all frames, float32 (frames, ...).

    ``names`` are those of the values of one frame, or of its axes if it has two.
    """

    values: NDArray[np.float32]
    names: list[str]


class Stream:
    """Times, nanoseconds, and numbers of one topic, on disk; a picture has no numbers (``None``).

    Attributes:
        width: How many numbers an item has; ``None`` before the first.
        n: Number of items.
        first_ns: Time of the first item.
        last_ns: Time of the newest item.
    """

    def __init__(self, times: Iterable[int] = (), rows: Iterable[Sequence[float] | None] = ()) -> None:
        self.width: int | None = None
        self.n = self.first_ns = self.last_ns = 0
        self._times, self._numbers = array("q"), array("f")
        self._spool: Spool | None = None
        for t_ns, row in zip(times, rows, strict=True):
            self.add(t_ns, row)

    def add(self, t_ns: int, row: Sequence[float] | None) -> None:
        """Add an item, with as many numbers as those before it."""
        numbers = row or ()
        if self.width is None:
            self.width = len(numbers)
        elif self.width != len(numbers):
            raise ValueError(f"{len(numbers)} numbers after {self.width}")
        self._add(t_ns, numbers, 1)

    def _add(self, t_ns: int, numbers: Sequence[float], n: int) -> None:
        """Add ``n`` items of one time."""
        if not self.n:
            self.first_ns = t_ns
        self.last_ns = t_ns
        self.n += n
        self._times.extend((t_ns,) * n)
        self._numbers.extend(numbers)
        if len(self._times) >= _MOST_HELD:
            self._spooled()

    def _spooled(self) -> Spool:
        """Write the items that are still in memory, and return all of them."""
        dtype = np.dtype([("t_ns", np.int64), ("row", np.float32, (self.width or 0,))])
        if self._spool is None:
            self._spool = Spool(dtype)
        if self._times:
            items = np.empty(len(self._times), dtype)
            items["t_ns"] = self._times
            items["row"] = np.frombuffer(self._numbers, np.float32).reshape(items["row"].shape)
            self._spool.add(items)
            self._times, self._numbers = array("q"), array("f")
        return self._spool

    @property
    def rows(self) -> NDArray[np.float32]:
        """Numbers of all items, float32 (items, numbers)."""
        rows: NDArray[np.float32] = self._spooled().read(0, self.n)["row"]
        return rows

    @cached_property
    def known(self) -> NDArray[np.bool_]:
        """Whether each number is finite in any item; no item may be added afterwards."""
        known: NDArray[np.bool_] = np.logical_or.reduce(np.isfinite(self.rows))
        return known

    def around(self, grid_ns: NDArray[np.int64], n: int = 1) -> tuple[int, NDArray[Any], NDArray[np.int64]]:
        """Read only the items that are among the newest ``n`` at any of some ascending times.

        Returns the number of the first of these items, the items, and the newest one's index at each time.
        """
        items = self._spooled()

        def time_of(k: int) -> int:
            return int(items.read(k, k + 1)["t_ns"][0])

        begin, end = (bisect_right(range(self.n), int(grid_ns[k]), key=time_of) for k in (0, -1))
        begin = max(begin - n, 0)
        found = items.read(begin, end)
        return begin, found, np.searchsorted(found["t_ns"], grid_ns, side="right") - 1

    def at(self, grid_ns: NDArray[np.int64]) -> NDArray[np.float32]:
        """Return the newest value at each of some ascending times; NaN and infinity become 0."""
        _, items, newest = self.around(grid_ns)
        rows: NDArray[np.float32] = items["row"][newest]
        return np.nan_to_num(rows, posinf=0.0, neginf=0.0)


class Chunks(Stream):
    """EMG samples: each is an item, at the time of its chunk."""

    def add_samples(self, t_ns: int, samples: Sequence[float], n_channels: int) -> None:
        """Add a chunk: its samples one after the other, the channels of each together."""
        if self.width not in {None, n_channels} or len(samples) % n_channels:
            raise ValueError(f"{len(samples)} numbers of {n_channels} channels after {self.width} channels")
        self.width = n_channels
        self._add(t_ns, samples, len(samples) // n_channels)

    def fit(self, fps: int) -> int:
        """Take as many samples to a frame as come in one, rounded up; return when so many are there, nanoseconds."""
        items = self._spooled()
        n_first, _, _ = self.around(np.array([self.first_ns]), 0)
        spent_s = (self.last_ns - self.first_ns) / _S
        rate_hz = (self.n - n_first) / spent_s if spent_s > 0 else float(fps)
        self._n = max(1, int(np.ceil(round(rate_hz / fps, 3))))
        enough = min(self._n, self.n)
        return int(items.read(enough - 1, enough)["t_ns"][0])

    def at(self, grid_ns: NDArray[np.int64]) -> NDArray[np.float32]:
        """Return the newest samples at each time, float32 (times, samples, channels)."""
        _, items, newest = self.around(grid_ns, self._n)
        numbers = newest[:, None] + 1 - self._n + np.arange(self._n)
        rows: NDArray[np.float32] = items["row"][np.maximum(numbers, 0)]
        return np.nan_to_num(rows)


def closure_numbers(level: int, closure: float | None) -> tuple[float, float]:
    """Return the numbers of a command to the hand, as :data:`CLOSURE` names them."""
    return level, max(0.0, (joined_level(level, closure) - 1.0) / 4.0)


def _touch(contact: records.Contact) -> tuple[float, ...]:
    """Return the numbers of a contact that are observed; NaN for those that its metric does not give."""
    known = (getattr(contact, name) for name in _MEASURED)
    return (contact.eda, contact.cci, contact.in_contact, *(np.nan if one is None else one for one in known))


def _pose(pose: records.PoseRecord) -> tuple[float, ...]:
    return (*pose.position, *pose.quaternion)


OBSERVED: Final[dict[type[records.Record], Callable[[Any], Sequence[float]]]] = {
    records.ArmMeasured: _pose,
    records.ArmTarget: _pose,
    records.Contact: _touch,
    records.HandCommand: lambda one: closure_numbers(one.level, one.closure),
    records.Intent: lambda one: (*one.channels, one.level),
    records.Joints: attrgetter("angles_rad"),
    records.VestFrame: attrgetter("intensities"),
}
"""Numbers of each type of record that is observed."""


def columns_of(streams: dict[str, Stream], grid_ns: NDArray[np.int64]) -> dict[str, Column]:
    """Return the features of frames at some times, pictures left out.

    Each stream has begun by the first time, but for targets of the arm; samples fit the frames.
    """
    columns: dict[str, Column] = {}
    if joints := streams.get("/hand/joints"):
        columns["observation.state"] = Column(joints.at(grid_ns), list(JOINT_NAMES))
    contacts = [topic for topic in sorted(streams) if topic.endswith("/contact")]
    if contacts:
        by_finger = [streams[topic].at(grid_ns) for topic in contacts]
        for feature, part, subject in (
            ("observation.touch", slice(0, 3), ("eda", "cci", "in_contact")),
            ("observation.touch_si", slice(3, None), _MEASURED),
        ):
            values = np.concatenate([rows[:, part] for rows in by_finger], axis=1)
            names = [f"{topic.split('/')[2]}.{name}" for topic in contacts for name in subject]
            if part.start == 0 or any(streams[topic].known[part].any() for topic in contacts):
                columns[feature] = Column(values, names)
    images = [
        topic for topic in sorted(streams) if topic.startswith("/tactile/") and topic.endswith("/image")
    ]
    if images:
        ages_s = [
            (grid_ns - items["t_ns"][newest]) / _S
            for _, items, newest in (streams[topic].around(grid_ns) for topic in images)
        ]
        columns["observation.image_age"] = Column(
            np.stack(ages_s, axis=1).astype(np.float32), [f"{topic.split('/')[2]}.s" for topic in images]
        )
    if samples := streams.get("/emg/samples"):
        columns["observation.emg"] = Column(samples.at(grid_ns), ["sample", "channel"])
    if levels := streams.get("/emg/levels"):
        values = levels.at(grid_ns)
        names = [*_numbered("ch", values.shape[1] - 1), "fused"]
        columns["observation.emg_levels"] = Column(values, names)
    if vest := streams.get("/vest/frame"):
        values = vest.at(grid_ns)
        columns["observation.vest"] = Column(values, _numbered("motor", values.shape[1]))
    arm = streams.get(ARM_MEASURED)
    if arm is not None:
        columns["observation.arm"] = Column(arm.at(grid_ns), [f"arm.{name}" for name in PoseNumbers.table])
    requested: list[Column] = []
    if hand := streams.get("/hand/frames"):
        requested.append(Column(hand.at(grid_ns), list(CLOSURE)))
    if arm is not None:
        requested.append(Column(_targets(streams.get(ARM_TARGET), arm, grid_ns), list(ARM_ACTION)))
    if requested:
        values = np.concatenate([column.values for column in requested], axis=1)
        columns["action"] = Column(values, [name for column in requested for name in column.names])
    return columns


def _targets(target: Stream | None, arm: Stream, grid_ns: NDArray[np.int64]) -> NDArray[np.float32]:
    """Return the arm's target at each frame; before the first target, the arm's pose."""
    where = arm.at(grid_ns)
    if target is not None and target.n:
        known = grid_ns >= target.first_ns
        if known.any():
            where[known] = target.at(grid_ns[known])
    return where


def _numbered(name: str, n: int) -> list[str]:
    return [f"{name}{k}" for k in range(1, n + 1)]
