"""Find where the rows of a text table begin, its columns' names and units, and the rate that its preamble states."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from tega.errors import RecordingError
from tega.runtime.files.tables.dialect import MISSING, Dialect, is_number, split, uncommented
from tega.runtime.files.tables.numbers import CLOCK, displayed

_COMMENT_MARKS = ("#", "%", "//")
_RATE = re.compile(
    r"(?:sampl\w*[ _]*(?:rate|freq\w*|hz)|frequency|frequenz|abtastrate|\bfs\b|\brate\b|s?rate_hz)"
    r"[^\d\n]{0,24}(\d[\d.,]*)\s*(k?)",
    re.IGNORECASE,
)
_GROUPING = re.compile(r"[.,](?=.*[.,])")
_HERTZ = re.compile(r"(?<![\w.,-])(\d[\d.,]*)\s*(k?)Hz\b", re.IGNORECASE)
_FILTER = re.compile(r"filter|notch|pass|cut-?off|corner|band|mains|line", re.IGNORECASE)
# Seconds a sample: LabVIEW, LabChart, AcqKnowledge.
_STEP = re.compile(
    r"^(?:delta_x|interval=)\s*([\d.,eE+-]+)\s*(m|u|µ)?s?|^([\d.,]+)\s*(m|u|µ)?s(?:ec)?/sample", re.IGNORECASE
)
_LISTED = re.compile(r"^(\d+) channels$")
_COLUMNS, _SENSORS = (re.compile(rf'"{name}": ?\[([^\]]*)\]') for name in ("column", "sensor"))
_QUOTED = re.compile(r'"([^"]*)"')
_UNITS = frozenset(
    (
        *("s", "ms", "us", "µs", "ns", "v", "mv", "uv", "µv", "g", "n", "nm", "%", "hz"),
        *("deg", "deg/s", "m/s²", "m/s^2"),
        *("1", "-", "a.u.", "au", "counts", "°"),
    )
)
_MOST_LOOKED = 20


class Header(NamedTuple):
    """Lines before the rows of a table, and the shape of a row.

    Attributes:
        first: Place of the first row among the lines.
        width: Cells of a row as it stands in the file.
        n_columns: Columns without an empty one behind a last delimiter.
        names: Names of the columns, ``""`` for one without; empty if the table has none.
        clock: Whether each column holds dates or times of day.
    """

    first: int
    width: int
    n_columns: int
    names: list[str]
    units: list[str]
    numeric: list[bool]
    clock: list[bool]
    preamble: list[str]


def find_header(lines: Sequence[str], dialect: Dialect, name: str) -> Header:
    """Return where a table begins; a damaged row of numbers before the first good one is refused."""
    cells: dict[int, list[str]] = {}
    for at, line in enumerate(lines):
        if text := (uncommented(line) if not line.startswith("#") else "").strip():
            cells[at] = dialect.split(line if dialect.delimiter == "\t" and "#" not in line else text)
    tail = list(cells.values())[-300:]
    rows = [row for row in tail if any(is_number(cell, dialect.decimal) for cell in row)]
    width = Counter(map(len, rows)).most_common(1)[0][0] if rows else 0
    rows = [row for row in rows if len(row) == width]
    numeric = [_mostly([row[c] for row in rows], dialect.decimal) for c in range(width)]
    body = [at for at, row in cells.items() if _is_row(row, numeric, dialect.decimal)]
    if not body:
        raise _no_rows(lines, cells, name)
    first = _begin(body, list(cells))
    above = [at for at in cells if at < first]
    names, units, first = _names(lines, cells, above, first, numeric, dialect, name)
    taken = set(range(first)) if not above else {at for at in above if at >= above[-1]}
    preamble = [
        line for at, line in enumerate(lines[:first]) if line.strip() and (not names or at not in taken)
    ]
    n_columns = width
    while n_columns > 1 and not any([*names[n_columns - 1 :], *(cells[at][n_columns - 1] for at in body)]):
        n_columns -= 1
    named = names[:n_columns] + [""] * max(0, n_columns - len(names)) if names else []
    clock = [bool(rows) and all(CLOCK.fullmatch(row[c]) for row in rows[-5:]) for c in range(width)]
    return Header(first, width, n_columns, named, units, numeric, clock, preamble)


def stated_rate(preamble: Sequence[str]) -> float | None:
    """Return the samples per second that lines before a table state; ``None`` if they state none, or several.

    Example:
        >>> stated_rate(["%Sample Rate = 250 Hz"]), stated_rate(["Frequency,250"]), stated_rate(["fs: 1 kHz"])
        (250.0, 250.0, 1000.0)
    """
    found: dict[bool, set[float]] = {True: set(), False: set()}
    for line in preamble:
        of_emg = "emg" in line.lower()
        if _FILTER.search(line) and "sampl" not in line.lower():
            continue
        for digits, kilo in _RATE.findall(line) or _HERTZ.findall(line):
            # All signs but the last one group thousands; the last one does, too, where the rate would be no rate.
            number = _GROUPING.sub("", digits.rstrip(".,")).replace(",", ".")
            rate_hz = float(number) * (1000.0 if kilo else 1.0)
            if rate_hz < 10.0 and re.fullmatch(r"\d{1,3}\.\d{3}", number):
                rate_hz *= 1000.0
            if 1.0 <= rate_hz <= 1e6:
                found[of_emg].add(rate_hz)
        if step := _STEP.match(line):
            digits, unit = step[1] or step[3], (step[2] or step[4] or "").lower()
            try:
                step_s = float(digits.replace(",", ".")) * {"": 1.0, "m": 1e-3}.get(unit, 1e-6)
            except ValueError:
                continue
            found[True] |= {float(f"{1 / step_s:.9g}")} if 1e-6 <= step_s <= 1.0 else set()
    rates = found[True] or found[False]
    return rates.pop() if len(rates) == 1 else None


def _mostly(column: list[str], decimal: str) -> bool:
    there = [cell for cell in column if cell.lower() not in MISSING]
    return 2 * sum(is_number(cell, decimal) for cell in there) >= len(there)


def _is_row(row: list[str], numeric: list[bool], decimal: str) -> bool:
    if len(row) != len(numeric):
        return False
    wanted = [cell for cell, is_wanted in zip(row, numeric, strict=True) if is_wanted]
    good = [is_number(cell, decimal) for cell in wanted]
    return any(good) and all(ok or cell.lower() in MISSING for ok, cell in zip(good, wanted, strict=True))


def _begin(body: list[int], there: list[int]) -> int:
    """Return the first row that others follow; a line of a preamble may look like one."""
    rows = set(body)
    for at in body:
        after = there[there.index(at) + 1 :][:_MOST_LOOKED]
        if 2 * sum(k in rows for k in after) >= len(after):
            return at
    return body[0]


def _names(  # noqa: PLR0917  # of one place in the file
    lines: Sequence[str], cells: dict[int, list[str]], above: list[int], first: int, numeric: list[bool],
    dialect: Dialect, name: str,
) -> tuple[list[str], list[str], int]:  # fmt: skip
    width = len(numeric)
    if found := _listed(lines[:first], dialect, width):
        # AcqKnowledge writes how many samples each channel has before the first one.
        counts = found[1] and all(cell.isdigit() for cell in cells[first] if cell)
        return *found, next((at for at in cells if at > first), first) if counts else first
    if found := _above(lines, cells, above, numeric, dialect, name):
        return *found, first
    after = [row for at, row in cells.items() if at > first and len(row) == width]
    if _are_ordinals(cells[first]) and _is_header_of_numbers(cells[first], after, numeric):
        return cells[first], [], next((at for at in cells if at > first), first)
    comments = [line for line in lines[:first] if line.startswith(_COMMENT_MARKS)]
    head = dialect.split(comments[-1].lstrip("#%/ ")) if comments else []
    if len(head) == width > 1 and not _has_numbers(head, numeric, dialect.decimal):
        return head, [], first
    return [], [], first


def _above(  # noqa: PLR0917  # of one place in the file
    lines: Sequence[str], cells: dict[int, list[str]], above: list[int], numeric: list[bool],
    dialect: Dialect, name: str,
) -> tuple[list[str], list[str]] | None:  # fmt: skip
    """Return names and units that stand right above the first row; ``None`` if none do."""
    width = len(numeric)
    if not above:
        return None
    if dialect.joined:  # names have no decimal sign
        cells[above[-1]] = [cell.strip() for cell in lines[above[-1]].split(",")]
    head = cells[above[-1]]
    for sign in "\t;,|" if len(head) != width else "":
        other = split(lines[above[-1]], sign, quoted=True)
        head = other if len(other) == width else head
    if abs(len(head) - width) > 1 or (width <= 2 and len(head) != width):
        return None
    shifted = [""] * (len(head) == width - 1) + head
    if not _has_numbers(shifted, numeric, dialect.decimal):
        upper = cells[above[-2]] if len(above) > 1 else []
        paired = len(upper) == len(head) and not _has_numbers(upper, numeric, dialect.decimal)
        bare = [cell.lstrip("#% ").strip().strip('"') for cell in shifted]
        return (upper, head) if paired and _are_units(head) else (bare, [])
    if _are_ordinals(head):
        return head, []
    is_key = len(head) == 2 and re.match(r"[A-Za-z_ ]{3,}[:=]?$", head[0])  # and its value, as in a preamble
    if len(head) == width and not is_key:
        raise RecordingError(
            f"{name}:{above[-1] + 1}: not a row of numbers: {displayed(lines[above[-1]])}",
            "fix or delete that line, or name the channels to read without its column",
        )
    return None


def _listed(lines: Sequence[str], dialect: Dialect, width: int) -> tuple[list[str], list[str]] | None:
    """Return names and units that stand in a list before the table: AcqKnowledge, LabChart, OpenSignals."""
    for at, line in enumerate(lines):
        text = line.strip()
        if text.lower().startswith("channeltitle="):
            titles = [cell for cell in dialect.split(text)[1:] if cell]
            if len(titles) in {width, width - 1}:
                return ["time"] * (width - len(titles)) + titles, []
        names, sensors = (_QUOTED.findall(" ".join(part.findall(text))) for part in (_COLUMNS, _SENSORS))
        if names and len(names) in {width, width - 1}:
            n = max(0, len(names) - len(sensors))  # the last columns are the sensors'
            return names[:n] + [f"{a} {b}" for a, b in zip(sensors, names[n:], strict=False)], []
        if (found := _LISTED.match(text)) and int(found[1]) in {width, width - 1}:
            n = int(found[1])
            pairs = [one.strip() for one in lines[at + 1 : at + 1 + 2 * n]]
            head = dialect.split("".join(lines[at + 1 + 2 * n : at + 2 + 2 * n]))  # the time's unit in front
            if len(pairs) == 2 * n:
                more = width - n
                return ["time"] * more + pairs[::2], head[:more] + pairs[1::2]
    return None


def _has_numbers(head: list[str], numeric: list[bool], decimal: str) -> bool:
    return any(is_wanted and is_number(cell, decimal) for cell, is_wanted in zip(head, numeric, strict=False))


def _are_units(head: list[str]) -> bool:
    bare = [cell.strip("[]() ").lower() for cell in head]
    return any(bare) and all(not cell or cell in _UNITS for cell in bare)


def _are_ordinals(head: list[str]) -> bool:
    """Return whether cells are different whole numbers from 0, perhaps behind an empty one."""
    digits = head[1:] if head and not head[0] else head
    return bool(digits) and all(cell.isdigit() for cell in digits) and len(set(digits)) == len(digits)


def _is_header_of_numbers(head: list[str], rows: list[list[str]], numeric: list[bool]) -> bool:
    """Return whether a first row of whole numbers names the columns: all others are written with decimals."""
    if not head[0] and len(head) > 1:
        return True
    if len(rows) < 5 or not all(numeric):
        return False
    if len(head) >= 3 and head == [str(k) for k in range(len(head))]:
        return True
    written = [cell for row in rows for cell in row if cell.lower() not in MISSING]
    return all("." in cell or "," in cell or "e" in cell.lower() for cell in written)


def _no_rows(lines: Sequence[str], cells: dict[int, list[str]], name: str) -> RecordingError:
    words = [cell for row in cells.values() for cell in row if cell.lower() not in MISSING]
    if len(cells) > 1 and words:
        at = list(cells)[-1]
        return RecordingError(
            f"{name}:{at + 1}: not a row of numbers: {displayed(lines[at])}",
            "give a table with a row per sample",
        )
    return RecordingError(f"{name}: holds no sample", "a table with a row per sample is expected")
