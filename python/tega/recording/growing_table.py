"""Write tables with columns that become known as the rows arrive, some rows at a time.

A column that later rows bring goes to the end, empty in earlier ones. Neither kind of table keeps more than some
thousand rows in memory, however many it has.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from itertools import repeat
from pathlib import Path
from typing import IO, Any, Final

import msgspec
import numpy as np

from tega.runtime.files.csv_tables import cell_text
from tega.runtime.lifecycle import require

Columns = Mapping[str, Sequence[Any]]
"""Cells of some rows, by column; all of one length."""
_ROWS_PER_GROUP: Final = 1 << 14
# Sizes that Python writes without an exponent.
_LEAST_DECIMAL, _MOST_DECIMAL = 1e-4, 1e16


def _set_aside(path: Path) -> Path:
    """Give a file another name, to be written again with further columns."""
    return path.replace(path.with_name(f"{path.name}.part"))


class GrowingCsv:
    """A CSV table."""

    def __init__(self, path: Path) -> None:
        self.path, self.empty = path, True
        self._names: dict[str, None] = {}
        self._file: IO[str] | None = None

    def close(self) -> Path:
        """Write all that is left and return the file."""
        if self._file is not None:
            self._file.close()
        return self.path

    def append(self, part: Path) -> None:
        """Add the rows of a finished table of this kind."""
        self.empty = False
        with part.open(encoding="utf-8", newline="") as file:
            lines = csv.reader(file)
            columns = next(lines)
            to = self._file_with(columns)
            if columns == list(self._names):
                to.writelines(file)
                return
            for cells in lines:
                row = dict(zip(columns, cells, strict=True))
                to.write(",".join([cell_text(row.get(name, "")) for name in self._names]) + "\n")

    def add(self, columns: Columns) -> None:
        """Add rows, at least one."""
        self.empty = False
        to = self._file_with(columns)
        texts = [_texts(columns[name]) if name in columns else repeat("") for name in self._names]
        to.write("\n".join(map(",".join, zip(*texts, strict=False))) + "\n")

    def _file_with(self, columns: Iterable[str]) -> IO[str]:
        """Return the file; where it has not all of these columns, it is begun, or written again with them."""
        known = len(self._names)
        self._names |= dict.fromkeys(columns)
        if self._file is not None and len(self._names) == known:
            return self._file
        old = None
        if self._file is not None:
            self.close()
            old = _set_aside(self.path)
        self._file = self.path.open("w", encoding="utf-8", newline="\n")
        self._file.write(",".join(map(cell_text, self._names)) + "\n")
        if old is not None:
            self.append(old)
            old.unlink()
        return self._file


def _texts(cells: Sequence[Any]) -> Iterable[str]:
    """Return cells as :func:`cell_text` does; JSON writes the same digits of a float, and a column at once."""
    kinds = set(map(type, cells))
    if kinds == {float}:
        texts = msgspec.json.encode(cells)[1:-1].decode().split(",")
        size = np.abs(np.array(cells))
        # JSON spells the others otherwise, or not at all.
        decimal = (size == 0.0) | (size >= _LEAST_DECIMAL) & (size < _MOST_DECIMAL)
        for k in np.flatnonzero(~decimal).tolist():
            texts[k] = repr(cells[k])
        return texts
    if kinds in ({bool}, {str}):  # few of them differ
        return map({cell: cell_text(cell) for cell in set(cells)}.__getitem__, cells)
    return map(repr if kinds == {int} else cell_text, cells)


class GrowingParquet:
    """A table as Parquet."""

    def __init__(self, path: Path) -> None:
        self.path, self.empty = path, True
        self._arrow = require("pyarrow", driver="export", extra="parquet")
        self._parquet = require("pyarrow.parquet", driver="export", extra="parquet")
        self._parts: list[Any] = []
        self._n_waiting = 0
        self._file: Any = None

    def close(self) -> Path:
        """Write all that is left and return the file."""
        if self._parts:
            self._write_group()
        self._file.close()
        return self.path

    def append(self, part: Path) -> None:
        """Add the rows of a finished table of this kind."""
        self.empty = False
        with self._parquet.ParquetFile(part) as source:
            for k in range(source.num_row_groups):
                self._take(source.read_row_group(k))

    def add(self, columns: Columns) -> None:
        """Add rows, at least one."""
        self.empty = False
        self._take(self._arrow.table({name: self._array(cells) for name, cells in columns.items()}))

    def _array(self, cells: Sequence[Any]) -> Any:
        """Return cells as the package would, out of memory: of a list it asks pandas, which takes long to load."""
        arrow, kinds, buffers = self._arrow, set(map(type, cells)), list[Any]()
        if kinds == {float}:
            type_, buffers = arrow.float64(), [np.array(cells)]
        elif kinds == {int} and (numbers := np.array(cells)).dtype == np.int64:
            type_, buffers = arrow.int64(), [numbers]
        elif kinds == {bool}:
            type_, buffers = arrow.bool_(), [np.packbits(cells, bitorder="little")]
        elif kinds == {str}:
            texts = [cell.encode() for cell in cells]
            ends = np.cumsum([0, *map(len, texts)], dtype=np.int32)
            type_, buffers = arrow.string(), [ends, b"".join(texts)]
        else:
            return arrow.array(cells)
        return arrow.Array.from_buffers(type_, len(cells), [None, *map(arrow.py_buffer, buffers)])

    def _take(self, rows: Any) -> None:
        self._parts.append(rows)
        self._n_waiting += self._parts[-1].num_rows
        if self._n_waiting >= _ROWS_PER_GROUP:
            self._write_group()

    def _write_group(self) -> None:
        group = self._joined(self._parts)
        self._parts, self._n_waiting = [], 0
        if self._file is not None and group.schema != self._file.schema:
            group = self._joined([self._file.schema.empty_table(), group])
        if self._file is None or group.schema != self._file.schema:
            self._begin(group.schema)
        self._file.write_table(group)

    def _joined(self, tables: list[Any]) -> Any:
        return self._arrow.concat_tables(tables, promote_options="permissive")

    def _begin(self, schema: Any) -> None:
        """Begin the file, or write it again with further columns or wider types."""
        if self._file is None:
            self._file = self._parquet.ParquetWriter(self.path, schema)
            return
        self._file.close()
        old = _set_aside(self.path)
        self._file = self._parquet.ParquetWriter(self.path, schema)
        with self._parquet.ParquetFile(old) as source:
            for k in range(source.num_row_groups):
                self._file.write_table(self._joined([schema.empty_table(), source.read_row_group(k)]))
        old.unlink()


GrowingTable = GrowingCsv | GrowingParquet
