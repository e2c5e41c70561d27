"""Every Python program that TEGA starts is isolated from the working folder: nothing there is run instead of it."""

from __future__ import annotations

import ast
import re
import subprocess
from pathlib import Path

import pytest

import tega
from tega.runtime.child_process import python_command

PROJECT = Path(__file__).resolve().parents[3]
ROOTS = [PROJECT / name for name in ("python", "tools/campaigns", "tools/emulators")]
_SYSTEM = r"(os|pty)\.(exec|spawn|posix_spawn|system|popen|fork)"
STARTS = re.compile(
    r"(subprocess\.)?Popen|subprocess\.(run|call|check_call|check_output)|(.*\.)?create_subprocess_(exec|shell)"
    rf"|{_SYSTEM}\w*"
)
WORKERS = {"joblib", "multiprocessing", "ProcessPoolExecutor", "loky"}
# A file without any of these starts nothing, and is not parsed.
HINTS = re.compile(
    rf"Popen|subprocess|executable|from sys|[\"']python|\b{_SYSTEM}|{'|'.join(sorted(WORKERS))}"
)
OTHER_PROGRAMS = {
    "python/tega/devices/machine.py": "ip",
    "tools/campaigns/tega_campaigns/mutants/drawn.py": "cargo",
    "tools/emulators/tega_emulators/message_bus.py": "dbus-daemon",
    "tools/emulators/tega_emulators/openxr_runtime.py": "cargo",
}
"""What starts a program that is not Python."""


def dotted(node: ast.expr) -> str:
    """Return a name with dots, such as ``subprocess.run``; ``""`` for anything else but what ends with one."""
    if isinstance(node, ast.Attribute):
        return f"{dotted(node.value)}.{node.attr}"
    return node.id if isinstance(node, ast.Name) else ""


def started(path: Path) -> list[str]:
    """Return what a file of Python starts otherwise than by `python_command`, `python_environment` and the like."""
    text = path.read_text(encoding="utf-8")
    if not HINTS.search(text):
        return []
    tree = ast.parse(text)
    calls = {
        node: name for node in ast.walk(tree) if isinstance(node, ast.Call) if (name := dotted(node.func))
    }
    called = {name.rpartition(".")[2] for name in calls.values()}
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and dotted(node) == "sys.executable":
            found.append(f"{node.lineno}: names sys.executable")
        if isinstance(node, ast.ImportFrom) and node.module == "sys":
            found.append(f"{node.lineno}: imports from sys")
        if isinstance(node, ast.List | ast.Tuple) and node.elts:
            first = node.elts[0]
            named = first.value if isinstance(first, ast.Constant) else None
            if isinstance(named, str) and re.fullmatch(r"python[0-9.]*", named):
                found.append(f"{node.lineno}: names {named}")
    found += [
        f"{call.lineno}: starts without python_environment"
        for call, name in calls.items()
        if STARTS.fullmatch(name) and "python_environment" not in called
    ]
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    words = {word for node in imports for word in re.findall(r"\w+", ast.unparse(node))}
    if words & WORKERS and "isolated_workers" not in called:
        found.append("1: starts workers without isolated_workers")
    return found


@pytest.mark.skipif(not ROOTS[-1].is_dir(), reason="not a checkout")
def test_whoever_starts_python_goes_through_one_function() -> None:
    found = {
        path.relative_to(PROJECT).as_posix(): places
        for root in ROOTS
        for path in sorted(root.rglob("*.py"))
        if path.name != "child_process.py" and (places := started(path))
    }
    assert {path: places for path, places in found.items() if path not in OTHER_PROGRAMS} == {}
    assert set(OTHER_PROGRAMS) <= set(found), "starts no program any more"
    for path in OTHER_PROGRAMS:
        assert all("without python_environment" in place for place in found[path]), found[path]


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("import sys, subprocess\nsubprocess.run([sys.executable, '-m', 'tega.ui.cli'])", "sys.executable"),
        ("from sys import executable", "imports from sys"),
        ("subprocess.Popen(['python3', 'a.py'], env=python_environment())", "names python3"),
        ("subprocess.Popen(python_command('tega.ui.cli'))", "without python_environment"),
        ("await asyncio.create_subprocess_exec(*words)", "without python_environment"),
        ("os.execv(words[0], words)", "without python_environment"),
        ("from concurrent.futures import ProcessPoolExecutor", "without isolated_workers"),
        ("import multiprocessing.pool", "without isolated_workers"),
    ],
)
def test_what_goes_past_it_is_found(source: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text(source)
    assert any(message in place for place in started(tmp_path / "a.py"))


def test_a_program_finds_the_package_s_folder_and_nothing_inside_it() -> None:
    package = Path(tega.__file__).resolve().parent
    # The module `site` prints the import path.
    message = subprocess.run(python_command("site"), capture_output=True, text=True, check=True).stdout
    assert repr(str(package.parent)) in message
    assert repr(str(package)) not in message
