"""The notebooks run from their first cell to the last."""

from __future__ import annotations

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
        "-p",
        "nbmake",
        "--nbmake",
        str(NOTEBOOKS / f"{name}.ipynb"),
    ]
    done = subprocess.run([sys.executable, *words], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout
    assert "1 passed" in done.stdout
