"""Packages in a folder as an installer leaves them, and programs that find them there."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

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


def program(
    *words: object, folder: Path | None = None, env: Mapping[str, str] | None = None, code: int = 0
) -> subprocess.CompletedProcess[str]:
    """Run a program to its end, which has to come with this code."""
    how: dict[str, Any] = {"stdin": subprocess.DEVNULL, "capture_output": True, "text": True, "timeout": 600}
    done = subprocess.run(list(map(str, words)), cwd=folder, env=env, check=False, **how)
    assert done.returncode == code, f"{words}\n{done.stdout}\n{done.stderr}"
    return done


def python(*words: str, site: Path, folder: Path, code: int = 0) -> tuple[str, str]:
    """Run a program of Python in a folder, and return what it printed and what it told."""
    env = os.environ | {"PYTHONPATH": os.pathsep.join([str(site), *sys.path])}
    done = program(sys.executable, *words, folder=folder, env=env, code=code)
    return done.stdout, done.stderr
