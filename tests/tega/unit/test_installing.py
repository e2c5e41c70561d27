"""Installing from a checkout: one sentence where Rust is missing, and one version wherever a version is stated."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest

import tega
from tega.runtime.child_process import own_group

PROJECT = Path(__file__).resolve().parents[3]


def toml(*parts: str) -> dict[str, Any]:
    return tomllib.loads(PROJECT.joinpath(*parts).read_text(encoding="utf-8"))


def test_without_rust_pip_is_told_so_in_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    system = toml("pyproject.toml")["build-system"]
    code = f"import sys; sys.path[:0] = {system['backend-path']!r}; import {system['build-backend']}"
    monkeypatch.setenv("PATH", str(tmp_path))
    assert shutil.which("cargo") is None
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=PROJECT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    (sentence,) = done.stderr.splitlines()
    assert "no program `cargo` on the PATH" in sentence
    oldest = toml("Cargo.toml")["workspace"]["package"]["rust-version"]
    assert f"Rust {oldest} or later" in sentence


def test_a_guard_is_out_of_reach_of_the_terminal() -> None:
    assert own_group("linux") == own_group("darwin") == {"start_new_session": True}
    assert own_group("win32") == {"creationflags": 0x200}  # CREATE_NEW_PROCESS_GROUP
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE, **own_group()) as guard:
        if sys.platform != "win32":
            assert os.getpgid(guard.pid) == guard.pid
        guard.kill()


def test_the_version_is_one() -> None:
    version = toml("Cargo.toml")["workspace"]["package"]["version"]
    assert tega.__version__ == version
    for tool in ("emulators", "campaigns", "figures"):
        assert toml("tools", tool, "pyproject.toml")["project"]["version"] == version
    cited = re.search(
        r"^version: (.+)$", (PROJECT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert cited is not None
    assert cited[1] == version
    newest = re.search(r"^## ([0-9.]+)", (PROJECT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert newest is not None
    assert newest[1] == version
    for lock in ("Cargo.lock", "benches/Cargo.lock", "fuzz/Cargo.lock"):
        crates = [one for one in toml(*lock.split("/"))["package"] if "source" not in one]
        ours = {one["version"] for one in crates if one["name"] not in {"tega-benches", "tega-fuzz"}}
        assert ours == {version}, lock
