"""Compare two courses of the same session and find where they differ."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import msgspec

Row = tuple[int, Mapping[str, Any]]
"""A time in nanoseconds and the values at that time, by name."""


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


class _Pair(NamedTuple):
    t_ns: int
    recorded: Mapping[str, Any]
    replayed: Mapping[str, Any]


def compare(
    stream: str, recorded: Sequence[Row], replayed: Sequence[Row], *, until_ns: int | None = None
) -> Comparison:
    """Compare two courses, row by row; numbers are equal when every bit is (every NaN is equal to any other).

    Args:
        stream: Its name.
        recorded: Rows in order of time; several may share one.
        replayed: Rows of the replay, in order of time.
        until_ns: Rows that only the replay has from here on are no difference: the recording was cut there.
    """
    differ, fields, last_ns = 0, dict[str, int](), -1
    first: list[Difference] = []
    for pair in _pairs(recorded, replayed):
        if pair.recorded is _ABSENT and until_ns is not None and pair.t_ns >= until_ns:
            continue
        names = [n for n in {**pair.recorded, **pair.replayed} if not _same(n, pair)]
        if not names:
            continue
        differ, last_ns = differ + 1, pair.t_ns
        for name in names:
            fields[name] = fields.get(name, 0) + 1
            if len(first) < _KEPT:
                first.append(
                    Difference(
                        pair.t_ns / 1e9,
                        name,
                        str(pair.recorded.get(name, "absent")),
                        str(pair.replayed.get(name, "absent")),
                    )
                )
    return Comparison(
        stream,
        len(recorded),
        len(replayed),
        differ,
        fields,
        None if last_ns < 0 else last_ns / 1e9,
        first,
    )


def _pairs(recorded: Sequence[Row], replayed: Sequence[Row]) -> Iterable[_Pair]:
    """Put rows of the same time beside each other."""
    i = j = 0
    while i < len(recorded) or j < len(replayed):
        ours = recorded[i][0] if i < len(recorded) else None
        theirs = replayed[j][0] if j < len(replayed) else None
        if ours is not None and ours == theirs:
            yield _Pair(ours, recorded[i][1], replayed[j][1])
            i, j = i + 1, j + 1
        elif theirs is None or (ours is not None and ours < theirs):
            assert ours is not None  # by the loop's condition
            yield _Pair(ours, recorded[i][1], _ABSENT)
            i += 1
        else:
            yield _Pair(theirs, _ABSENT, replayed[j][1])
            j += 1


def _same(name: str, pair: _Pair) -> bool:
    if name not in pair.recorded or name not in pair.replayed:
        return False
    ours, theirs = pair.recorded[name], pair.replayed[name]
    if isinstance(ours, float) and isinstance(theirs, float) and math.isnan(ours):
        return math.isnan(theirs)
    return bool(ours == theirs)
