"""Define a file's properties that are known before its samples are read: columns, rate, clock, events."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError
from tega.runtime.files.tables.judging import Name, Role, course_of, is_even, judged, unix_unit

Blocks = Callable[[Sequence[int]], Iterator["NDArray[np.float64]"]]
"""Reads columns by their numbers from 0; yields consecutive rows, float64 (n, columns), in blocks."""

MOST_JUDGED = 4096
"""So many rows at the beginning are looked at before a column is judged."""


class Reading(msgspec.Struct, frozen=True, kw_only=True):
    """Choices that decide where a file can be read in several ways.

    Attributes:
        channels: Columns to read, counted from 1; empty for those that are EMG.
        variable: Array, group or stream of a file that has several; ``emg`` also finds ``EMG`` and the only array.
        rate_hz: Samples per second; ``None`` for the file's own.
        decimal: Decimal sign of a text table.
        time: Column of the time, counted from 1; ``none`` to ignore the file's times.
        rows: Meaning of the rows of an array or table.
    """

    channels: tuple[Annotated[int, msgspec.Meta(ge=1)], ...] = ()
    variable: str = "emg"
    rate_hz: Annotated[float, msgspec.Meta(gt=0, le=10_000_000)] | None = None
    decimal: Literal["auto", "point", "comma"] = "auto"
    time: Literal["auto", "none"] | Annotated[int, msgspec.Meta(ge=1)] = "auto"
    rows: Literal["auto", "samples", "channels"] = "auto"


class FileEvent(msgspec.Struct, frozen=True, kw_only=True):
    """An event that a file holds beside its samples; ``t_s`` is since the first sample."""

    t_s: float
    text: str


class Column(msgspec.Struct, kw_only=True):
    """A column of a table and its content.

    Attributes:
        number: Its number, from 1.
        name: Its name, without the unit; ``""`` if it has none.
        unit: Its unit; ``""`` if the file does not state it.
        holds: Its content; ``unknown`` may be a channel.
        why: ``name`` or ``values``; ``""`` if neither decides.
        constant: Whether the first values are all the same.
        unix: Unit of its times since 1970; ``""`` if it has none.
        even: Whether it rises by the same step from row to row.
    """

    number: int
    name: str = ""
    unit: str = ""
    holds: Role = "unknown"
    why: str = ""
    constant: bool = False
    unix: str = ""
    even: bool = False

    @property
    def called(self) -> str:
        """Its name in quotes, or its number."""
        return f'"{self.name}"' if self.name else f"column {self.number}"


@dataclass
class Table:
    """A file of samples, opened and judged; its samples are read by :meth:`load`.

    Attributes:
        facts: Encoding, delimiter and the like, by name.
        rate_hz: Samples per second as the file states them, at the place ``rate_from``.
        times_s: Time of each row in seconds, where the format has a clock of its own.
        notes: Facts that a reader of the results must know.
    """

    file: str
    format: str
    columns: list[Column]
    blocks: Blocks
    facts: dict[str, str] = field(default_factory=dict)
    rate_hz: float | None = None
    rate_from: str = ""
    times_s: NDArray[np.float64] | None = None
    events: list[FileEvent] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    sideways: bool = False

    def load(
        self, channels: Sequence[int], beside: Sequence[int]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Read channels, and columns beside them, by numbers from 0; return both, float64 (n, columns).

        This takes little more memory than they do.
        """
        blocks, n = self.blocks([*channels, *beside]), len(channels)
        first, second = next(blocks, np.empty((0, n + len(beside)))), next(blocks, None)
        if second is None:
            return np.ascontiguousarray(first[:, :n], np.float64), np.asarray(first[:, n:], np.float64)
        kept, others = bytearray(), bytearray()
        for rows in itertools.chain((first, second), blocks):
            kept += np.ascontiguousarray(rows[:, :n], np.float64).tobytes()
            others += np.ascontiguousarray(rows[:, n:], np.float64).tobytes()
        samples = np.frombuffer(kept, np.float64).reshape(-1, n)
        return samples, np.frombuffer(others, np.float64).reshape(len(samples), -1)


def judged_columns(
    names: Sequence[str], head: NDArray[np.float64], *, units: Sequence[str] = (), text: Sequence[bool] = ()
) -> list[Column]:
    """Judge columns by their names and first values.

    ``names`` stand as in the file, none for a table without; ``head`` is float64 (n, columns), NaN for a cell
    without a number; ``units`` stand apart from the names; ``text`` is whether each column holds words.
    """
    columns = []
    for at in range(head.shape[1]):
        values = head[:MOST_JUDGED, at]
        unit = units[at].strip("[]() ") if at < len(units) else ""
        name = judged(names[at], unit) if at < len(names) else Name("", "", "unknown")
        column = Column(number=at + 1, name=name.text, unit=name.unit, holds=name.role)
        column.why = "" if name.role == "unknown" else "name"
        course = course_of(values)
        column.constant, column.even = course == "constant", is_even(values)
        column.unix = unix_unit(values) if course in {"time", "counter"} else ""
        if at < len(text) and text[at] and name.role != "label":
            column.holds, column.why = "text", "values"
        elif course == "label" and name.role == "unknown":
            column.holds, column.why = "label", "values"
        elif course in {"time", "counter"} and name.role in {"unknown", "channel"}:
            column.holds, column.why = "time" if column.unix else course, "values"
        columns.append(column)
    return columns


def oriented(array: NDArray[np.float64], file: str, *, rows: str) -> tuple[NDArray[np.float64], bool]:
    """Return an array of real numbers with a row per sample, and whether it had a row per channel.

    ``array`` is (n,) or (n, m), ``rows`` is ``auto``, ``samples`` or ``channels``; one that may be both is
    refused.
    """
    array = np.asarray(array)
    if array.dtype.kind not in "iuf":
        raise RecordingError(
            f"{file}: holds {array.dtype}, expected real numbers", "export the samples alone"
        )
    if array.ndim == 1:
        array = array[:, None]
    if array.ndim != 2:
        raise RecordingError(
            f"{file}: an array of shape {array.shape}, expected (samples, channels)", "export it as a table"
        )
    n_rows, n_columns = array.shape
    if rows == "samples" or (rows == "auto" and n_rows >= n_columns):
        return array, False
    if rows == "channels":
        return array.T, True
    if n_columns <= _MOST_CHANNELS:
        return array, False
    if 4 * n_rows <= n_columns:
        return array.T, True  # more columns than an amplifier has channels, and hardly a sample
    raise RecordingError(
        f"{file}: {n_rows} rows and {n_columns} columns: either can be the samples",
        "set rows to samples, or to channels if each row is a channel",
    )


# Fewer rows than so many columns are still rows of samples: a short recording of an amplifier.
_MOST_CHANNELS = 64


def in_one(array: NDArray[Any]) -> Blocks:
    """Return a function that reads columns of an array, (n, columns), as one block."""
    every = list(range(array.shape[1]))
    return lambda columns: iter([array if list(columns) == every else array[:, list(columns)]])
