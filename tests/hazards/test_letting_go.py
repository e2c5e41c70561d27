"""Each signal to each process, and each lost terminal: the hand is let go in the time of the hazard table.

``make letting-go`` writes the same cells with their times to docs/evidence/faults.md; ``make deep`` tries all here.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from hazards.letting_go import CELLS, Cell, problem, try_cell

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="signals, pseudo-terminals and /proc"),
]

TIMES = 10


def _often(cell: Cell) -> bool:
    """Whether a cell is tried by ``make slow``: every fault of a whole run, and what differs from that elsewhere."""
    if cell.subject == "run" and cell.targets == "hand process + guard":
        return cell.event in {"KILL", "STOP 3 s"}
    return cell.targets in {"all", "main"} and (cell.subject == "run" or cell.event == "TERM, HUP")


@pytest.mark.parametrize(
    "cell",
    [pytest.param(cell, marks=[] if _often(cell) else pytest.mark.deep) for cell in CELLS],
    ids=lambda cell: f"{cell.event}, {cell.targets} of {cell.subject}",
)
def test_a_cell_of_the_table(cell: Cell, tmp_path: Path) -> None:
    assert not problem(cell, try_cell(cell, tmp_path), TIMES)
