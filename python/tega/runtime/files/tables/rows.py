"""Read tables with named columns of words and numbers: poses, forces, marks."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from tega.errors import RecordingError
from tega.runtime.files.foreign_file import check_file
from tega.runtime.files.tables.dialect import NUMBER, split
from tega.runtime.files.tables.encoding import find_encoding, head_of, read_lines

_HEAD_BYTES = 65_536


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
