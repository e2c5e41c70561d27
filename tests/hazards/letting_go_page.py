"""Try every cell of the table of letting go, and write it into docs/evidence/faults.md: ``make letting-go``."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final

import pytest

from hazards.letting_go import CELLS, EVENTS, Cell, Seen, expected, try_cell
from hazards.programs import SUBJECTS
from tega_campaigns.runner import put_table, table

ROOT: Final = Path(__file__).parents[2]
PAGE: Final = ROOT / "docs/evidence/faults.md"
_NAME: Final = "letting go"
_NAMES: Final = {"main": "the command", "run": "the command", "all": "all three"}


def _text(cell: Cell, seen: Seen) -> str:
    if seen.outcome == "pushes":
        return "**switch**" if expected(cell).outcome == "pushes" else "**PUSHES**"
    if seen.outcome == "goes on":
        return "goes on"
    return f"{seen.took_s:.2f} s"


def read_page() -> dict[Cell, str]:
    """Return the text of each cell of the page's table."""
    text = PAGE.read_text("utf-8").split(f"<!-- {_NAME}: begin -->")[1].split(f"<!-- {_NAME}: end -->")[0]
    rows = [line for line in text.splitlines() if line.startswith("| ")]
    texts = [text.strip() for row in rows[1:] for text in row.strip("|").split("|")[2:]]
    cells = [Cell(*row, event) for row in _rows() for event in EVENTS]
    return dict(zip(cells, texts, strict=True)) if len(cells) == len(texts) else {}


def _rows() -> list[tuple[str, str]]:
    return list(dict.fromkeys((cell.subject, cell.targets) for cell in CELLS))


def page(seen: Mapping[Cell, Seen]) -> str:
    """Return the page's table; a cell that was not tried keeps its text."""
    before, rows = read_page(), list[tuple[str, ...]]()
    for subject, targets in _rows():
        cells = [Cell(subject, targets, event) for event in EVENTS]
        name = _NAMES.get(targets, targets.replace("run", "command"))
        texts = (_text(cell, seen[cell]) if cell in seen else before.get(cell, "–") for cell in cells)
        rows.append((f"`{SUBJECTS[subject].command}`", name, *texts))
    return table(("command", "processes", *EVENTS), rows)


def problem(cell: Cell, seen: Seen) -> str:
    """Return in which respect a cell is not as expected; ``""`` if it is."""
    requested = expected(cell)
    if seen.outcome != requested.outcome:
        return f"{seen.outcome} instead of {requested.outcome}: {seen.words}"
    if seen.old_torque:
        return "torque came after the standstill and before letting go"
    late = seen.took_s > requested.within_s and seen.outcome not in {"goes on", "pushes"}
    return f"{seen.took_s:.2f} s is more than {requested.within_s:g} s" if late else ""


def _try(cell: Cell) -> Seen | None:
    """Try a cell; ``None`` if its program did not come so far."""
    try:
        with tempfile.TemporaryDirectory(prefix="tega-letting-go-") as folder:
            seen = try_cell(cell, Path(folder))
    except (Exception, pytest.fail.Exception) as error:
        _say(f"{' | '.join(cell)} | not tried | {error}")
        return None
    _say(f"{' | '.join(cell)} | {_text(cell, seen)} | {problem(cell, seen)}")
    return seen


def _say(line: str) -> None:
    print(line, flush=True)  # noqa: T201  # this is a program


def main(arguments: Sequence[str] | None = None) -> int:
    """Try the cells that are asked for; return 0 if each is as expected."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="*", default=[], metavar="WORD", help="cells with all of these words")
    parser.add_argument("--jobs", type=int, default=2, help="cells at once")
    requested = parser.parse_args(arguments)
    chosen = [cell for cell in CELLS if all(word in " | ".join(cell) for word in requested.only)]
    with ThreadPoolExecutor(requested.jobs) as pool:
        tried = zip(chosen, pool.map(_try, chosen), strict=True)
        seen = {cell: outcome for cell, outcome in tried if outcome is not None}
    put_table(PAGE, page(seen), name=_NAME)
    wrong = [cell for cell in chosen if cell not in seen or problem(cell, seen[cell])]
    _say(f"{len(chosen) - len(wrong)} of {len(chosen)} cells are as expected")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
