"""The notebooks run from their first cell to the last, and hold the outputs of such a run."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

NOTEBOOKS = Path(__file__).resolve().parents[2] / "examples" / "notebooks"
NAMES = ("equations", "recording", "decoders")

pytestmark = pytest.mark.skipif(not NOTEBOOKS.is_dir(), reason="not a checkout")


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_runs(name: str) -> None:
    words = [
        "-m",
        "pytest",
        "-n0",
        "-q",
        "-p",
        "no:cacheprovider",
        "--nbmake",
        str(NOTEBOOKS / f"{name}.ipynb"),
    ]
    done = subprocess.run([sys.executable, *words], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout
    assert "1 passed" in done.stdout


@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_holds_its_outputs_and_is_small(name: str) -> None:
    path = NOTEBOOKS / f"{name}.ipynb"
    cells = [cell for cell in json.loads(path.read_text("utf-8"))["cells"] if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    assert any(cell["outputs"] for cell in cells)
    assert not any(one["output_type"] == "error" for cell in cells for one in cell["outputs"])
    assert path.stat().st_size < 100_000
