"""Write tables as CSV: comma separated, UTF-8, one newline a row, the same bytes on every machine."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import IO

_ROWS_PER_WRITE = 4096
_QUOTED = frozenset(',"\r\n')


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
        self._file: IO[str] | None = path.open("w", encoding="utf-8", newline="\n")
        self._lines: list[str] = [",".join(map(cell_text, columns)) + "\n"]
        self._most_lines = most_lines
        self.n_rows = 0

    def write(self, *lines: str) -> None:
        """Add lines; each ends with a newline."""
        self._lines.extend(lines)
        self.n_rows += len(lines)
        if len(self._lines) >= self._most_lines:
            self.flush()

    def flush(self) -> None:
        """Hand all lines to the file."""
        if self._file is not None:
            self._file.write("".join(self._lines))
        self._lines.clear()

    def close(self) -> None:
        """Write the remaining rows and close the file; closing twice does nothing."""
        file = self._file
        if file is None:
            return
        try:
            self.flush()
        finally:
            self._file = None
            file.close()
