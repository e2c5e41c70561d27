"""Write tables with columns that become known as the rows arrive.

A CSV needs memory for some thousand rows, a Parquet file for its columns of numbers.
"""

from __future__ import annotations

import csv
from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any, Final

from tega.runtime.files.csv_writer import CsvWriter, cell_text
from tega.runtime.lifecycle import require

Row = dict[str, Any]
_ROWS_KEPT: Final = 4096


class GrowingTable(ABC):
    """Takes rows and writes them some thousand at a time; a column that a later row brings goes to the end.

    Args:
        path: The file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.n_rows = 0
        self._names: Row = {}
        self._rows: list[Row] = []

    def add(self, row: Row) -> None:
        """Add a row: its cells by their columns."""
        self._rows.append(row)
        self.n_rows += 1
        if len(self._rows) >= _ROWS_KEPT:
            self._flush()

    def close(self) -> Path:
        """Write all that is left and return the file."""
        self._flush()
        self._end()
        return self.path

    def _flush(self) -> None:
        n_names = len(self._names)
        for row in self._rows:
            if row.keys() != self._names.keys():
                self._names |= dict.fromkeys(row)
        self._write(self._rows, list(self._names), grown=n_names < len(self._names))
        self._rows.clear()

    @abstractmethod
    def _write(self, rows: list[Row], names: list[str], *, grown: bool) -> None:
        """Write rows; ``grown`` if some of the names are new."""

    @abstractmethod
    def _end(self) -> None:
        """Finish the file."""


class GrowingCsv(GrowingTable):
    """A CSV table; a column that appears late is added to the earlier rows, empty."""

    _file: CsvWriter | None = None

    def _write(self, rows: list[Row], names: list[str], *, grown: bool) -> None:
        if grown and self._file is not None:
            self._widen(names)
        elif self._file is None:
            self._file = CsvWriter(self.path, names)
        assert self._file is not None
        self._file.write(*[",".join([cell_text(row.get(name)) for name in names]) + "\n" for row in rows])

    def _widen(self, names: list[str]) -> None:
        self._end()
        old = self.path.replace(self.path.with_name(f"{self.path.name}.part"))
        self._file = CsvWriter(self.path, names)
        with old.open(encoding="utf-8", newline="") as file:
            lines = csv.reader(file)
            next(lines)
            for cells in lines:
                self._file.write(",".join(map(cell_text, [*cells, *[""] * (len(names) - len(cells))])) + "\n")
        old.unlink()

    def _end(self) -> None:
        if self._file is not None:
            self._file.close()


class GrowingParquet(GrowingTable):
    """A table as Parquet, kept as columns of numbers until it is written."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._arrow = require("pyarrow", driver="export", extra="parquet")
        self._parts: list[Any] = []

    def _write(self, rows: list[Row], names: list[str], *, grown: bool) -> None:  # noqa: ARG002
        self._parts.append(self._arrow.table({name: [row.get(name) for row in rows] for name in names}))

    def _end(self) -> None:
        parquet = require("pyarrow.parquet", driver="export", extra="parquet")
        parquet.write_table(self._arrow.concat_tables(self._parts, promote_options="permissive"), self.path)
