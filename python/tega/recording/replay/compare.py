"""Compare two courses of the same session and find where they differ."""

from __future__ import annotations

import math
from bisect import insort
from collections import deque
from collections.abc import Callable, Mapping
from functools import cache
from operator import attrgetter, itemgetter
from typing import Any

import msgspec

from tega.loop.inbox.stream import NEVER_NS


class Difference(msgspec.Struct, frozen=True):
    """One place where two courses differ.

    Attributes:
        t_s: Time since the start of the session, seconds.
        field: Name of the field that differs.
        recorded: Its value in the recording, as text; ``absent`` where only the replay has it.
        replayed: Its value in the replay, as text; ``absent`` if only the recording has it.
    """

    t_s: float
    field: str
    recorded: str
    replayed: str


class Comparison(msgspec.Struct, frozen=True):
    """One stream compared.

    Attributes:
        stream: Its topic.
        recorded: Rows in the recording.
        replayed: Rows in the replay.
        differ: Rows that differ or are in one of them only.
        fields: Number of differing rows, by field.
        last_t_s: Time of the last row that differs; ``None`` where none does.
        first: The first differences.
    """

    stream: str
    recorded: int
    replayed: int
    differ: int
    fields: dict[str, int]
    last_t_s: float | None
    first: list[Difference]


_ABSENT: Mapping[str, Any] = {}
_KEPT = 5


class Compared:
    """Compares a stream's records with those of its replay as they come.

    Both sides give their records nearly in the order of their times: the last frame of a run is stamped with the run's
    end, which may be before that of its last tick. Numbers are equal when every bit is; every NaN equals any other.

    Args:
        stream: Its name.
        values: Returns the values of a record by name.
        left_out: Fields that are not compared.
        shared: If true, what only the replay has is no difference, and does not count.
    """

    def __init__(
        self,
        stream: str,
        values: Callable[[Any], Mapping[str, Any]],
        *,
        left_out: frozenset[str] = frozenset(),
        shared: bool = False,
    ) -> None:
        self.stream, self._values, self._left_out, self._shared = stream, values, left_out, shared
        self.n_recorded = self.n_replayed = self.last_recorded_ns = 0
        # Time, time at which it was known, and record, by time.
        self._recorded, self._replayed = deque[tuple[int, int, Any]](), deque[tuple[int, int, Any]]()
        self._differ, self._last_ns, self._cut_ns = 0, -1, NEVER_NS
        self._fields: dict[str, int] = {}
        self._first: list[Difference] = []

    def recorded(self, record: Any, t_ns: int, known_ns: int = 0) -> None:
        """Add a record of the recording, with its time and the tick at which it was known."""
        self.n_recorded, self.last_recorded_ns = self.n_recorded + 1, t_ns
        _put(self._recorded, (t_ns, known_ns or t_ns, record))

    def replayed(self, record: Any, t_ns: int, known_ns: int = 0) -> None:
        """Add a record of the replay."""
        self.n_replayed += not self._shared
        _put(self._replayed, (t_ns, known_ns or t_ns, record))

    def settle(self, until_ns: int) -> None:
        """Compare what can be: both sides are complete up to a tick."""
        ours, theirs = self._recorded, self._replayed
        while ours or theirs:
            if ours and theirs and ours[0][0] == theirs[0][0]:
                self.n_replayed += self._shared
                self._pair(ours[0][0], ours.popleft()[-1], theirs.popleft()[-1])
                continue
            first = ours if not theirs or (ours and ours[0][0] < theirs[0][0]) else theirs
            if first[0][1] >= until_ns:
                return
            t_ns, _, record = first.popleft()
            if first is ours:
                self._pair(t_ns, record, None)
            elif not self._shared and t_ns < self._cut_ns:
                self._pair(t_ns, None, record)

    def result(self, cut_ns: int | None = None) -> Comparison:
        """Compare the rest, and return the findings.

        Args:
            cut_ns: What only the replay has from here on is no difference: the recording was cut there.
        """
        self._cut_ns = NEVER_NS if cut_ns is None else cut_ns
        self.settle(NEVER_NS)
        last_t_s = None if self._last_ns < 0 else self._last_ns / 1e9
        return Comparison(
            self.stream, self.n_recorded, self.n_replayed, self._differ, self._fields, last_t_s, self._first
        )

    def _pair(self, t_ns: int, ours: Any, theirs: Any) -> None:
        if ours == theirs or (type(ours) is type(theirs) and _equal_but(self._left_out, ours, theirs)):
            return
        sides = [_ABSENT if record is None else self._values(record) for record in (ours, theirs)]
        names = [
            name
            for name in {**sides[0], **sides[1]}
            if name not in self._left_out and not _same(name, *sides)
        ]
        self._differ += bool(names)
        for name in names:
            self._last_ns = t_ns
            self._fields[name] = self._fields.get(name, 0) + 1
            if len(self._first) < _KEPT:
                texts = (str(side.get(name, "absent")) for side in sides)
                self._first.append(Difference(t_ns / 1e9, name, *texts))


def _put(rows: deque[tuple[int, int, Any]], row: tuple[int, int, Any]) -> None:
    """Put a row behind those of its time and before, which is nearly always at the end."""
    if not rows or rows[-1][0] <= row[0]:
        rows.append(row)
    else:
        insort(rows, row, key=itemgetter(0))


def _equal_but(left_out: frozenset[str], ours: Any, theirs: Any) -> bool:
    """Return whether two records of one type are equal at first sight, some fields left out."""
    if not isinstance(ours, msgspec.Struct):
        return False
    read = _compared_fields(type(ours), left_out)
    return all(a == b or (a != a and b != b) for a, b in zip(read(ours), read(theirs), strict=True))  # noqa: PLR0124


@cache
def _compared_fields(
    kind: type[msgspec.Struct], left_out: frozenset[str]
) -> Callable[[Any], tuple[Any, ...]]:
    names = [name for name in kind.__struct_fields__ if name not in left_out]
    return attrgetter(*names) if len(names) > 1 else lambda one: tuple(getattr(one, name) for name in names)


def _same(name: str, ours: Mapping[str, Any], theirs: Mapping[str, Any]) -> bool:
    if name not in ours or name not in theirs:
        return False
    a, b = ours[name], theirs[name]
    if isinstance(a, float) and isinstance(b, float) and math.isnan(a):
        return math.isnan(b)
    return bool(a == b)
