"""Each signal to each process, and each lost terminal: the hand is let go in the time of the hazard table.

``make letting-go`` writes the same cells with their times to docs/evidence/faults.md.
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


@pytest.mark.parametrize("cell", CELLS, ids=lambda cell: f"{cell.event}, {cell.targets} of {cell.subject}")
def test_a_cell_of_the_table(cell: Cell, tmp_path: Path) -> None:
    assert not problem(cell, try_cell(cell, tmp_path), TIMES)
