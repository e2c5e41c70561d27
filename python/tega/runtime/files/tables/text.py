"""Open a text table: look at its beginning, decide how it is written, then read the wanted columns block by block."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError
from tega.runtime.files.tables.decide import check_channels
from tega.runtime.files.tables.dialect import Dialect, find_dialect, uncommented
from tega.runtime.files.tables.encoding import Encoding, Lines, find_encoding, head_of, read_lines
from tega.runtime.files.tables.header import Header, find_header, stated_rate
from tega.runtime.files.tables.numbers import RowParser, displayed, number_of
from tega.runtime.files.tables.table import MOST_JUDGED, Reading, Table, in_one, judged_columns, oriented

_HEAD_BYTES = 65_536
_FEWEST_LINES = 64
_GLUED = re.compile(r"[\[({=]\s*[-+]?[\d.]|\d\s*[\])}]")  # as in JSON and printed lists
_SIGNS = {"auto": "", "point": ".", "comma": ","}


def open_text(path: Path, reading: Reading) -> Table:
    """Open a text table; refused where it holds no sample or can be read in several ways."""
    encoding = find_encoding(head_of(path, _HEAD_BYTES), path.name)
    blocks = read_lines(path, encoding)
    lines, ended = _beginning(blocks)
    blocks.close()  # type: ignore[attr-defined]
    reported = [text for line in lines if not line.startswith("#") and (text := uncommented(line).strip())]
    dialect = find_dialect(reported, path.name, decimal=_SIGNS[reading.decimal])
    header = find_header(lines, dialect, path.name)
    body = lines[header.first : header.first + MOST_JUDGED]
    rows = [dialect.split(uncommented(line).strip(" \r\n")) for line in body if line.strip()]
    rows = [row for row in rows if len(row) == header.width]
    if _is_sideways(rows, header, reading, ended=ended):
        return _sideways(path, rows, header, dialect, encoding, reading)
    n = header.n_columns
    # Only the first rows are judged, cell by cell, since a column of them may hold words.
    head = np.array([[_value(cell, dialect.decimal) for cell in row[:n]] for row in rows]).reshape(-1, n)
    words = [not (number or clock) for number, clock in zip(header.numeric, header.clock, strict=True)]
    columns = judged_columns(header.names, head, units=header.units, text=words)
    worded = [column.number - 1 for column in columns if column.holds == "text"]
    glued = [row[at] for row in rows[-1:] for at in worded if _GLUED.search(row[at])]
    if glued and not reading.channels:
        raise RecordingError(f"{path.name}: a number among signs: {displayed(glued[0])}", "name the channels")
    for column, clock, number in zip(columns, header.clock, header.numeric, strict=False):
        if clock and not number:
            column.holds, column.unit, column.why = "time", "s", column.why or "values"
    rate_hz = stated_rate([*header.preamble, *(line for line in lines[: header.first] if line[:1] in "#%")])

    def read_columns(wanted: Sequence[int]) -> Iterator[NDArray[np.float64]]:
        parser = RowParser(path.name, dialect, header.width, wanted)
        for block in read_lines(path, encoding):
            skip = max(0, header.first + 1 - block.first)
            if skip < len(block.lines):
                yield parser.parse(block.first + skip, block.lines[skip:])

    kind = "OpenBCI GUI" if any("OpenBCI" in line for line in header.preamble[:4]) else "text"
    facts = _facts(header, dialect, encoding)
    rate_from = "the lines before the table" if rate_hz else ""
    return Table(path.name, kind, columns, read_columns, facts, rate_hz, rate_from)


def _facts(header: Header, dialect: Dialect, encoding: Encoding) -> dict[str, str]:
    numbers = all(name.isdigit() or not name for name in header.names)
    return {
        "encoding": encoding.displayed,
        "delimiter": dialect.name,
        "decimal": "comma" if dialect.decimal == "," else "point",
        "first_line": str(header.first + 1),
        "names": "" if not header.names else "numbers" if numbers else "words",
    }


def _beginning(blocks: Iterator[Lines]) -> tuple[list[str], bool]:
    """Return the first lines, and whether they are all."""
    lines: list[str] = []
    for block in blocks:
        lines += block.lines
        if len(lines) > max(_FEWEST_LINES, 2 * MOST_JUDGED):
            return lines[: 2 * MOST_JUDGED], False
        if len(lines) > _FEWEST_LINES:
            return lines, next(blocks, None) is None
    return lines, True


def _value(cell: str, decimal: str) -> float:
    try:
        return number_of(cell, decimal)
    except ValueError:
        return float("nan")


def _is_sideways(rows: list[list[str]], header: Header, reading: Reading, *, ended: bool) -> bool:
    if reading.rows != "auto":
        return reading.rows == "channels" and ended
    return ended and 0 < len(rows) <= _FEWEST_LINES < header.width and 4 * len(rows) <= header.width


def _sideways(  # noqa: PLR0917  # of one file
    path: Path, rows: list[list[str]], header: Header, dialect: Dialect, encoding: Encoding, reading: Reading
) -> Table:
    """Return a table in which each row is a channel, perhaps with its name in the first column."""
    named = not header.numeric[0]
    names = [row[0] for row in rows] if named else []
    try:
        array = np.array(
            [[number_of(cell, dialect.decimal) for cell in row[named : header.n_columns]] for row in rows]
        )
    except ValueError as error:
        raise RecordingError(
            f"{path.name}: a row per channel, and one holds more than numbers: {str(error)[:60]!r}",
            "export it with a row per sample",
        ) from error
    check_channels(path.name, reading.channels, len(array))
    array, _ = oriented(array, path.name, rows="channels")
    columns = judged_columns(names, array[:MOST_JUDGED])
    return Table(
        path.name, "text", columns, in_one(array),
        _facts(header, dialect, encoding) | {"names": ""}, sideways=True,
    )  # fmt: skip
