"""The Rust crates' own tests, as part of the one test command."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parents[2]


@pytest.mark.skipif(
    shutil.which("cargo") is None, reason="cargo is not installed: the Rust tests are not run"
)
@pytest.mark.parametrize("folder", [".", "fuzz"])
@pytest.mark.timeout(1800)
def test_cargo_test_passes(folder: str) -> None:
    """Run the core crates' tests, and the fuzz targets over their committed seeds."""
    if not (PROJECT / folder / "Cargo.toml").is_file():
        pytest.skip(f"no {folder}/Cargo.toml beside the tests: not a checkout")
    command = ["cargo", "test", "--quiet", "--locked", "--workspace"]
    if folder == ".":
        command += ["--exclude", "tega-py"]
    env = os.environ | {"CARGO_TERM_COLOR": "never"}
    done = subprocess.run(command, cwd=PROJECT / folder, env=env, text=True, capture_output=True, check=False)
    assert done.returncode == 0, f"{' '.join(command)}\n{done.stdout[-6000:]}\n{done.stderr[-6000:]}"
