"""Install TEGA again without one of its guests: a virtual environment in which that package is nowhere."""

from __future__ import annotations

import configparser
import importlib.metadata
import shutil
import sys
import sysconfig
import venv
from importlib.util import find_spec
from pathlib import Path


def environment_without(guest: str, folder: Path) -> Path:
    """Make an environment with the packages of this one, but for a guest and its entry points; return its Python."""
    venv.create(folder, symlinks=True, with_pip=False)
    base = {"base": str(folder), "platbase": str(folder)}
    into = Path(sysconfig.get_path("purelib", "venv", base))
    for path in map(Path, sys.path):
        if path.name in {"site-packages", "dist-packages"} and path.is_dir():
            for entry in path.iterdir():
                if not entry.name.startswith(("tega", "_tega", "__editable__")) and entry.suffix != ".pth":
                    link = into / entry.name
                    if not link.exists():
                        link.symlink_to(entry)
    for name in _packages() - {guest}:
        spec = find_spec(name)
        assert spec is not None
        assert spec.submodule_search_locations
        shutil.copytree(
            next(iter(spec.submodule_search_locations)),
            into / name,
            ignore=shutil.ignore_patterns("__pycache__"),
        )
    _metadata_without(guest, into)
    return folder / "bin" / "python"


def _packages() -> set[str]:
    """Return the packages of TEGA, by its entry points."""
    targets = importlib.metadata.distribution("tega").entry_points
    return {"tega"} | {one.module.partition(".")[0] for one in targets}


def _metadata_without(guest: str, into: Path) -> None:
    distribution = importlib.metadata.distribution("tega")
    there = into / f"tega-{distribution.version}.dist-info"
    there.mkdir()
    (there / "METADATA").write_text(distribution.read_text("METADATA") or "", encoding="utf-8")
    groups = configparser.ConfigParser(delimiters=("=",))
    groups.optionxform = str  # type: ignore[assignment,method-assign]  # names keep their case
    for one in distribution.entry_points:
        if one.module.partition(".")[0] != guest:
            if not groups.has_section(one.group):
                groups.add_section(one.group)
            groups.set(one.group, one.name, one.value)
    with (there / "entry_points.txt").open("w", encoding="utf-8") as file:
        groups.write(file)
