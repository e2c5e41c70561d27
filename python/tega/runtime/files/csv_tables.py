"""Write tables as CSV, and decode small text tables of other programs.

Those written here are comma separated, UTF-8, one newline a row, the same bytes on every machine. Of others encoding,
delimiter, quotes and decimal sign are found out.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from tega.errors import RecordingError
from tega.runtime.files.foreign_file import read_foreign
from tega.runtime.files.tables.encoding import find_encoding

_ROWS_PER_WRITE = 4096
_QUOTED = frozenset(',"\r\n')

_DELIMITERS: Final = ("\t", ";", ",")
_PREAMBLE_ROWS: Final = 100
_CLOCK: Final = re.compile(r"(-?)(\d+):(\d{1,2}):(\d{1,2}(?:[.,]\d+)?)")


def time_text(t_ns: int) -> str:
    """Write a time as seconds with six decimals, by integer arithmetic.

    Example:
        >>> time_text(33_333_333)
        '0.033333'
    """
    seconds, micros = divmod((t_ns + 500) // 1000, 1_000_000)
    return f"{seconds}.{micros:06d}"


def cell_text(value: object) -> str:
    """Write a value as a cell: nothing for ``None``, 0 or 1 for a truth, a number so that it is read back bit for bit.

    Example:
        >>> cell_text("held, then lost"), cell_text(0.1), cell_text(None)
        ('"held, then lost"', '0.1', '')
    """
    if type(value) is float or type(value) is int:  # nearly all cells
        return repr(value)
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(int(value))
    text = repr(value) if isinstance(value, float) else str(value)
    if _QUOTED.isdisjoint(text):
        return text
    return '"' + text.replace('"', '""') + '"'


class CsvWriter:
    """Writes finished lines to a file, many at a time."""

    def __init__(self, path: Path, columns: Sequence[str], *, most_lines: int = _ROWS_PER_WRITE) -> None:
        self._file = path.open("w", encoding="utf-8", newline="\n")
        self._lines: list[str] = [",".join(map(cell_text, columns)) + "\n"]
        self._most_lines = most_lines

    def write(self, *lines: str) -> None:
        """Add lines; each ends with a newline."""
        self._lines.extend(lines)
        if len(self._lines) >= self._most_lines:
            self.flush()

    def flush(self) -> None:
        """Hand all lines to the file."""
        if not self._file.closed:
            self._file.write("".join(self._lines))
        self._lines.clear()

    def close(self) -> None:
        """Write the remaining rows and close the file; closing twice does nothing."""
        try:
            self.flush()
        finally:
            self._file.close()


def read_rows(path: Path, *needed: set[str], most_mib: int, hint: str) -> tuple[list[list[str]], int]:
    """Return the rows of a table, and the number of the row that names the columns, one of ``needed`` among them.

    The delimiter is the one that separates these. Without such a row, ``RecordingError`` with ``hint`` names what
    is missing of the first.
    """
    try:
        data = read_foreign(path, most_mib=most_mib)
    except OSError as error:
        raise RecordingError(f"{path.name}: cannot be read: {error.strerror or error}", hint) from error
    if data[:4] in {b"PK\x03\x04", b"\xd0\xcf\x11\xe0"}:
        raise RecordingError(f"{path.name}: is a workbook, not a table of text", hint)
    try:
        encoding = find_encoding(data, path.name)
        text = data[encoding.mark :].decode(encoding.name)
    except (UnicodeDecodeError, RecordingError) as error:
        raise RecordingError(f"{path.name}: is no table of text: {error}", hint) from error
    best: set[str] = set()
    for delimiter in _DELIMITERS:
        try:
            rows = [
                [cell.strip() for cell in row]
                for row in csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)
            ]
        except csv.Error as error:
            raise RecordingError(f"{path.name}: is no table of text: {error}", hint) from error
        for number, row in enumerate(rows[:_PREAMBLE_ROWS]):
            if any(one <= set(row) for one in needed):
                return rows, number
            best = max(best, needed[0] & set(row), key=len)
    missing = ", ".join(sorted(needed[0] - best))
    raise RecordingError(f"{path.name}: has no column {missing}", hint)


def seconds(cell: str) -> float:
    """Return a finite time, seconds, from ``2.5``, ``2,5`` or ``00:00:02.5``; else ``ValueError``."""
    if (clock := _CLOCK.fullmatch(cell)) is not None:
        sign, hours, minutes, rest = clock.groups()
        t_s = (int(hours) * 60 + int(minutes)) * 60 + float(rest.replace(",", "."))
        return -t_s if sign else t_s
    try:
        t_s = float(cell.replace(",", ".") if cell.count(",") == 1 and "." not in cell else cell)
    except ValueError:
        t_s = math.nan
    if not math.isfinite(t_s):
        raise ValueError(f"{cell[:40]!r} is no time")
    return t_s
