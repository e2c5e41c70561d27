"""Turn lines of a text table into numbers, quickly where all cells are numbers, or into rows of named cells."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from datetime import datetime
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError
from tega.runtime.files.foreign_file import check_file
from tega.runtime.files.tables.dialect import MISSING, NUMBER, Dialect, split, uncommented
from tega.runtime.files.tables.encoding import find_encoding, head_of, read_lines

CLOCK: Final = re.compile(
    r"(?:(?:(\d{4}-\d\d-\d\d)|\d{1,4}[./-]\d{1,2}[./-]\d{2,4})(?:T|,? +))?"
    r"(\d{1,2}):(\d\d):(\d\d)([.,:]\d+)?(?: ?([AP])M)?(?:Z|[+-]\d\d:?\d\d)?",
    re.IGNORECASE,
)
"""A time of day, perhaps with its date, as ``2026-11-28 12:30:01.250``, ``28.11.2026 12:30:01`` or ``1:30:01 PM``."""

_MOST_DISPLAYED = 60
_PLAIN: Final = str.maketrans("\N{MINUS SIGN}", "-", "'’\xa0\u202f")

_HEAD_BYTES = 65_536


def clock_s(cell: str) -> float:
    """Return seconds since 1970, or since midnight for a time without a date as in ISO 8601; else ``ValueError``."""
    found = CLOCK.fullmatch(cell)
    if found is None:
        raise ValueError(cell)
    day, hour, minutes, seconds, part, half = found.groups()
    hours = int(hour) if half is None else int(hour) % 12 + 12 * (half in "pP")
    days = (datetime.fromisoformat(day) - datetime(1970, 1, 1)).days if day else 0  # differences only
    fraction = float(f"0.{part[1:]}") if part else 0.0
    return days * 86400.0 + hours * 3600 + int(minutes) * 60 + int(seconds) + fraction


def number_of(cell: str, decimal: str) -> float:
    """Return a cell's number, NaN for one that is missing; ``ValueError`` where it is no number."""
    if NUMBER[decimal].fullmatch(cell):
        cell = cell.translate(_PLAIN)
        if decimal == ",":
            return float(cell.replace(".", "").replace(",", "."))
        return float(cell.replace(",", ""))
    if cell.lower() in MISSING:
        return float("nan")
    return clock_s(cell)


def displayed(line: str) -> str:
    """Return a line for an error, cut short."""
    return repr(line if len(line) <= _MOST_DISPLAYED else line[: _MOST_DISPLAYED - 3] + "...")


class RowParser:
    """Parses the wanted columns of rows."""

    def __init__(self, name: str, dialect: Dialect, width: int, columns: Sequence[int]) -> None:
        self._name, self._dialect, self._width, self._columns = name, dialect, width, tuple(columns)
        self._may_be_fast = not dialect.joined and dialect.delimiter != ""

    def parse(self, first: int, lines: Sequence[str]) -> NDArray[np.float64]:
        """Return the numbers of lines, float64 (n, columns); empty lines and comments are left out.

        Another number of cells, or a wanted cell that is no number, is ``RecordingError``.
        """
        if self._may_be_fast:
            try:
                return self._fast(lines)
            except (ValueError, OverflowError):
                pass  # a cell is missing, a comment stands in between, or a line is damaged
        rows = [row for at, line in enumerate(lines, start=first) if (row := self._row(at, line)) is not None]
        return np.array(rows, np.float64).reshape(-1, len(self._columns))

    def _fast(self, lines: Sequence[str]) -> NDArray[np.float64]:
        dialect, text = self._dialect, [line for line in lines if line]
        if not text:
            return np.empty((0, len(self._columns)))
        quoted = dialect.quoted and any('"' in line for line in text)
        if dialect.delimiter is None:
            if any(len(line.split()) != self._width for line in text):
                raise ValueError
        elif not quoted and any(line.count(dialect.delimiter) != self._width - 1 for line in text):
            raise ValueError
        if dialect.decimal == ",":
            if dialect.delimiter == "," or any("." in line for line in text):
                raise ValueError
            text = [line.replace(",", ".") for line in text]
        return np.loadtxt(
            text, np.float64, comments=None, delimiter=dialect.delimiter, usecols=self._columns, ndmin=2,
            quotechar='"' if quoted else None,
        )  # fmt: skip

    def _row(self, number: int, raw: str) -> list[float] | None:
        line = uncommented(raw).strip("\r\n " if self._dialect.delimiter == "\t" else None)
        if not line.strip():
            return None
        cells = self._dialect.split(line)
        if len(cells) == self._width + 1 and not cells[-1]:
            cells.pop()  # a tab before the comment of LabChart
        if len(cells) == self._width - 1 and self._dialect.delimiter and self._width - 1 not in self._columns:
            cells.append("")  # nobody wants what is missing
        if len(cells) != self._width:
            raise RecordingError(
                f"{self._name}:{number}: {len(cells)} cells, the lines before have {self._width}: {displayed(line)}",
                "fix or delete that line",
            )
        try:
            return [number_of(cells[c], self._dialect.decimal) for c in self._columns]
        except ValueError as error:
            raise RecordingError(
                f"{self._name}:{number}: not a row of numbers: {displayed(line)}",
                "fix or delete that line, or name the channels to read without its column",
            ) from error


class NamedRow(NamedTuple):
    """A row of a table; ``line`` is its number in the file, from 1, ``cells`` are by the columns' names.

    Numbers have a decimal point, whatever the file has.
    """

    line: int
    cells: dict[str, str]


def named_rows(path: Path, *, most_mib: int) -> tuple[list[str], Iterator[NamedRow]]:
    """Return the names of a table's columns, none for an empty file, and its rows.

    Encoding, delimiter (comma, semicolon or tab) and decimal sign are found out. A row that has fewer cells
    than names lacks the last ones; one that has more is refused.
    """
    check_file(path, most_mib=most_mib)
    encoding = find_encoding(head_of(path, _HEAD_BYTES), path.name)
    lines = (
        (block.first + k, line)
        for block in read_lines(path, encoding)
        for k, line in enumerate(block.lines)
        if line.strip() and not line.lower().startswith("sep=")
    )
    _, head = next(lines, (0, ""))
    delimiter = max(",;\t", key=head.count)
    names = split(head, delimiter, quoted=True) if head else []
    return names, _rows(path.name, lines, names, delimiter)


def _rows(
    name: str, lines: Iterator[tuple[int, str]], names: list[str], delimiter: str
) -> Iterator[NamedRow]:
    for number, line in lines:
        try:
            cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
        except csv.Error as error:
            raise RecordingError(f"{name}:{number}: {error}", "export the table as CSV") from error
        if len(cells) > len(names) and any(cell.strip() for cell in cells[len(names) :]):
            raise RecordingError(f"{name}:{number}: {len(cells)} cells, the line of names has {len(names)}")
        reported = [cell.strip() for cell in cells]
        if delimiter != ",":
            reported = [
                cell.replace(",", ".") if "," in cell and NUMBER[","].fullmatch(cell) else cell
                for cell in reported
            ]
        yield NamedRow(number, dict(zip(names, reported, strict=False)))
