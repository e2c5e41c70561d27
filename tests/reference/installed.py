"""Packages in a folder as an installer leaves them, and programs that find them there."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Final

OWN_FEATURE: Final = Path(__file__).resolve().parents[2] / "examples/own_feature/src/own_feature"


def distribution(site: Path, name: str, entries: str) -> Path:
    """Lay a package's metadata and entry points into a folder, and return that."""
    info = site / f"{name.replace('-', '_')}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(entries)
    return site


def own_feature(site: Path) -> Path:
    """Install the example of a feature of one's own in a folder, and return that."""
    (site / "own_feature").symlink_to(OWN_FEATURE, target_is_directory=True)
    return distribution(site, "own-feature", "[tega.features]\ngrip = own_feature.feature:FEATURE\n")


def python(*words: str, site: Path, folder: Path, code: int = 0) -> tuple[str, str]:
    """Run a program of Python in a folder, and return what it printed and what it told."""
    done = subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(site), *sys.path])},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout, done.stderr
