"""Find out how a text table separates its cells and writes its decimals, from the lines themselves."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from typing import Final, NamedTuple

from tega.errors import RecordingError

MISSING: Final = frozenset(
    [
        *("", "na", "n/a", "#n/a", "#na", "nan", "-nan", "null", "none", "nil", "-", "--", "?"),
        *("missing", "#value!", "#wert!"),
    ]
)
"""Cells that hold no number, in lower case."""

_WHOLE = r"(?:\d{1,3}(?:['’\xa0\u202f]\d{3})+|\d+)"
_REST = r"(?:[eE][+-]?\d+)?|[+-]?inf(?:inity)?"
NUMBER: Final = {
    ".": re.compile(
        rf"[+\-\u2212]?(?:\d{{1,3}}(?:,\d{{3}})+\.\d*|{_WHOLE}\.?\d*|\.\d+){_REST}", re.IGNORECASE
    ),
    ",": re.compile(
        rf"[+\-\u2212]?(?:\d{{1,3}}(?:\.\d{{3}})+,\d+|{_WHOLE}(?:,\d+)?|,\d+){_REST}", re.IGNORECASE
    ),
}
"""Numbers by their decimal sign; thousands may be grouped by an apostrophe, a space that does not break or, where
there is a fraction, the other sign."""
# As the serial monitor of the Arduino IDE writes a line's time.
_STAMPED = re.compile(r"^(\d[\d:.,]*) -> ")

_COMMENT = re.compile(r"#(?!n/?a\b|value|wert|[\d,;|\t\"]|$)", re.IGNORECASE)  # no name's: EMG #1
# So many lines at the end of what was read first decide; they are far from the preamble.
_MOST_LINES = 150
_FEWEST_LINES = 8
_MOST_DIGITS = 60
_NAMES = {"\t": "tab", ";": "semicolon", ",": "comma", "|": "bar", None: "spaces", "": "one column"}


class Dialect(NamedTuple):
    """Signs of a text table.

    Attributes:
        delimiter: Between two cells; ``None`` for spaces and tabs, ``""`` for a table of one column.
        decimal: ``.`` or ``,``.
        joined: First halves of numbers that the comma between their digits cuts in two, as pieces from 0.
    """

    delimiter: str | None
    decimal: str = "."
    quoted: bool = False
    joined: tuple[int, ...] = ()

    @property
    def name(self) -> str:
        """The delimiter in a word."""
        return _NAMES.get(self.delimiter, repr(self.delimiter))

    def split(self, line: str) -> list[str]:
        """Return the cells of a line, without the empty one behind a last delimiter of a serial logger."""
        cells = split(line, self.delimiter, quoted=self.quoted)
        if not self.joined:
            return cells
        whole, at = [], 0
        while at < len(cells):
            pair = at in self.joined and at + 1 < len(cells)
            whole.append(",".join(cells[at : at + 2]) if pair else cells[at])
            at += 1 + pair
        return whole


def uncommented(line: str) -> str:
    """Return a line without ``#`` and the text after it."""
    return _COMMENT.split(line, maxsplit=1)[0] if "#" in line else line


def split(line: str, delimiter: str | None, *, quoted: bool) -> list[str]:
    """Return the cells of a line."""
    if delimiter != "":
        line = _STAMPED.sub(rf"\1{delimiter or ' '}", line)
    if not delimiter:
        return [line] if delimiter == "" else line.split()
    if quoted and '"' in line:
        try:
            cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
        except csv.Error:
            cells = line.split(delimiter)
    else:
        cells = line.split(delimiter)
    return [cell.strip() for cell in cells]


def is_number(cell: str, decimal: str) -> bool:
    """Return whether a cell is a finite or infinite number."""
    return NUMBER[decimal].fullmatch(cell) is not None


def find_dialect(lines: Sequence[str], name: str, *, decimal: str = "") -> Dialect:
    """Return a table's dialect; refused where nothing decides between decimal commas and delimiters."""
    probe = list(lines[-_MOST_LINES:])
    quoted = any('"' in line for line in lines)
    best, most = Dialect("", decimal or "."), 0.0
    for delimiter in ("\t", ";", ",", "|", None, ""):
        if delimiter != "" and not any(
            (delimiter or " ") in line or (not delimiter and "\t" in line) for line in probe
        ):
            continue
        cells = [split(line, delimiter, quoted=quoted) for line in probe]
        cells = [row[:-1] if len(row) > 1 and not row[-1] else row for row in cells]
        n_cells, n_lines = Counter(map(len, cells)).most_common(1)[0] if cells else (0, 0)
        for sign in [decimal] if decimal else [".", ","]:
            if sign == delimiter and not quoted:
                continue
            rows = [row for row in cells if len(row) == n_cells]
            good = sum(
                is_number(cell, sign) or cell.lower() in MISSING - {""} for row in rows for cell in row
            )
            share = good / (n_cells * n_lines) if n_cells * n_lines else 0.0
            score = share * n_lines / max(1, len(probe)) + (1e-3 if n_cells > 1 else 0.0)
            if share > 0 and probe and score > most + 1e-9:
                best, most = Dialect(delimiter, sign, quoted), score
    if decimal == "." or (best.delimiter, best.decimal) not in {(",", "."), ("", ","), (None, ",")}:
        return best
    return _comma_twice(probe, name, best, decimal=decimal)


def _comma_twice(probe: list[str], name: str, best: Dialect, *, decimal: str) -> Dialect:
    """Decide where a comma may be a decimal sign and a delimiter in one file."""
    if best.delimiter == "," and any("." in line or "," not in line for line in probe):
        return best
    cells = [line.split(",") for line in probe]
    plain = Dialect(",", ".", best.quoted)
    if best.delimiter != ",":  # one number a line, or a number between two spaces
        if any(" " in line.strip() or "\t" in line.strip() for line in probe) or decimal:
            return best
        fractions = [row[1] for row in cells if len(row) == 2]
        proven = any(len(f) > 1 and f.startswith("0") for f in fractions) or any(
            row[0] == "-0" for row in cells
        )
        if proven and len(probe) >= _FEWEST_LINES and all(f.isdigit() for f in fractions):
            return Dialect("", ",", best.quoted)
        best = plain
    n_cells = Counter(map(len, cells)).most_common(1)[0][0]
    cells = [row for row in cells if len(row) == n_cells]
    joined, at, proven = list[int](), 0, False
    while at < n_cells:
        left, right = [row[at] for row in cells], [row[at + 1] for row in cells] if at + 1 < n_cells else []
        sure = bool(right) and _is_fraction(left, right)
        if sure or decimal == ",":
            joined.append(at)
            proven |= sure
        at += 1 + bool(sure or decimal == ",")
    if decimal == "," or (joined and proven):
        return Dialect(",", ",", best.quoted, tuple(joined))
    if len(cells) >= _FEWEST_LINES and n_cells % 2 == 0 and _like_pairs(cells):
        raise RecordingError(
            f"{name}: a decimal comma or {n_cells} columns of whole numbers? {probe[-1][:60]!r} can be read as either",
            "set decimal to comma or point",
        )
    return plain


def _is_fraction(left: list[str], right: list[str]) -> bool:
    """Return whether a column holds digits behind a decimal sign: all of one length, some with leading zeros.

    A whole number is written without leading zeros and never as -0.
    """
    if not _like_fraction(right) or not all(cell.lstrip("+-").isdigit() for cell in left):
        return False
    return "-0" in left or (len(right[0]) > 1 and any(cell.startswith("0") for cell in right))


def _like_fraction(right: list[str]) -> bool:
    """Return whether a column may hold digits behind a decimal sign: all of one length, and different ones."""
    return all(cell.isdigit() for cell in right) and len({len(cell) for cell in right}) == 1


def _like_pairs(cells: list[list[str]]) -> bool:
    """Return whether every second column looks like digits behind a decimal sign, and the others like numbers."""
    for at in range(1, len(cells[0]), 2):
        right = [row[at] for row in cells]
        changes = sum(a != b for a, b in pairwise(right))
        # With three digits and so many lines one of them would begin with 0.
        settled = len(right[0]) > 1 and len(right) >= _MOST_DIGITS
        if not _like_fraction(right) or settled or len(set(right)) < 5 or 2 * changes < len(right):
            return False
        if any(cell.startswith(("-", "+")) for cell in right):
            return False
    return True
