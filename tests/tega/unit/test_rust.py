"""The Rust crates' own tests, as part of the one test command."""

from __future__ import annotations

import os
import random
import shutil
import subprocess
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parents[3]


@pytest.mark.skipif(
    shutil.which("cargo") is None, reason="cargo is not installed: the Rust tests are not run"
)
@pytest.mark.timeout(1800)
# Examples in documentation need each crate once more, compiled as others use it.
@pytest.mark.parametrize("which", [("--lib", "--tests"), pytest.param(("--doc",), marks=pytest.mark.slow)])
def test_cargo_test_passes(which: tuple[str, ...]) -> None:
    """Run the core crates' tests; they replay the fuzz targets over their committed seeds."""
    if not (PROJECT / "Cargo.toml").is_file():
        pytest.skip("no Cargo.toml beside the tests: not a checkout")
    # The extension itself is what the rest of this run tests; linking it again would need Python's libraries.
    # The emulator of an OpenXR runtime has no test of its own.
    left_out = ["--exclude", "tega-py", "--exclude", "tega-openxr-emulator"]
    command = ["cargo", "test", "--quiet", "--locked", "--workspace", *left_out, *which]
    # The properties draw from a seed, which is the same for every run in CI and is told where one fails.
    drawn = "1" if os.environ.get("CI") else str(random.randrange(2**63))
    seed = os.environ.get("PROPTEST_RNG_SEED", drawn)
    env = os.environ | {"CARGO_TERM_COLOR": "never", "PROPTEST_RNG_SEED": seed}
    if os.environ.get("CI"):
        # Nothing is built a second time there, and what a second time would need takes time to write.
        env["CARGO_INCREMENTAL"] = "0"
    done = subprocess.run(command, cwd=PROJECT, env=env, text=True, capture_output=True, check=False)
    again = f"PROPTEST_RNG_SEED={seed} {' '.join(command)}"
    assert done.returncode == 0, f"{again}\n{done.stdout[-6000:]}\n{done.stderr[-6000:]}"
