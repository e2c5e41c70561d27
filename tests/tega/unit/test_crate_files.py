"""No two files of a crate need each other, however many files lie between, unless one is the other's parent module."""

from __future__ import annotations

import re
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parents[3]
CRATES = sorted((PROJECT / "crates").glob("*/src"))

Module = tuple[str, ...]

pytestmark = pytest.mark.skipif(not CRATES, reason="not a checkout")


def code(text: str) -> str:
    """Return a file without its comments, texts and tests."""
    text = re.sub(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\])*"', "", text, flags=re.DOTALL)
    return re.sub(
        r"^#\[cfg\(test\)\]\n(?:#\[[^\n]*\n)*mod \w+ \{\n.*?^\}", "", text, flags=re.DOTALL | re.MULTILINE
    )


def modules(src: Path) -> dict[Module, str]:
    """Return the code of each file by the module that it is; the crate's root is the empty tuple."""
    found = {}
    for path in sorted(src.rglob("*.rs")):
        parts = path.relative_to(src).with_suffix("").parts
        found[parts[:-1] if parts[-1] in {"lib", "mod"} else parts] = code(path.read_text(encoding="utf-8"))
    return found


def branches(tree: str) -> list[str]:
    """Return every path of a tree in braces, ``a::{b, c::{d}}``; a new name after ``as`` is left out."""
    while inner := re.search(r"([\w:]*)\{([^{}]*)\}", tree):
        each = [f"{inner[1]}{one.strip()}" for one in inner[2].split(",") if one.strip()]
        tree = tree[: inner.start()] + ", ".join(each) + tree[inner.end() :]
    return [one.partition(" as ")[0].strip() for one in tree.split(",")]


def paths(text: str, module: Module, known: dict[Module, str]) -> Iterator[Module]:
    """Return every path within the crate that a file names, from the crate's root."""
    uses = [branch for tree in re.findall(r"\buse ([^;]+);", text) for branch in branches(tree)]
    used = [path for path in (from_root(use, module, known) for use in uses) if path is not None]
    yield from used
    short = {path[-1]: path for path in used if path in known}
    for name in re.findall(r"(?<![\w:])\w+(?:::\w+)+", re.sub(r"\buse [^;]+;", "", text)):
        first, *others = name.split("::")
        path = (*short[first], *others) if first in short else from_root(name, module, known)
        if path is not None:
            yield path


def from_root(path: str, module: Module, known: dict[Module, str]) -> Module | None:
    """Return a path as it is from the crate's root; None for a path of another crate."""
    first, *others = path.split("::")
    if first == "crate":
        return tuple(others)
    if first in {"self", "super"}:
        ups = [part == "super" for part in (first, *others) if part in {"self", "super"}]
        return (*module[: len(module) - sum(ups)], *others[len(ups) - 1 :])
    return (*module, first, *others) if (*module, first) in known else None


def owner(path: Module, known: dict[Module, str]) -> Module:
    """Return the file that has what a path names: names that a module takes from a child are the child's."""
    module = next(path[:n] for n in range(len(path), -1, -1) if path[:n] in known)
    if len(path) > len(module):
        name = path[len(module)]
        for inner in paths(known[module], module, known):
            if inner[-1] == name and inner[: len(module)] == module and inner != path[: len(module) + 1]:
                return owner(inner, known)
    return module


def needs(src: Path) -> dict[Module, set[Module]]:
    """Return which files a crate's files need, but a parent its own children and a child its own parent."""
    known = modules(src)
    return {
        module: {
            other
            for path in paths(text, module, known)
            if (other := owner(path, known)) != module and other[:-1] != module and module[:-1] != other
        }
        for module, text in known.items()
    }


@pytest.mark.parametrize("src", CRATES, ids=lambda src: src.parent.name)
def test_no_files_of_a_crate_need_each_other(src: Path) -> None:
    # Where it fails: move what both need into a file of its own, or one below the other.
    TopologicalSorter(needs(src)).prepare()


def test_a_circle_would_be_found(tmp_path: Path) -> None:
    files = {
        "lib.rs": "mod a;\nmod b;\nmod c;\npub use b::Thing;\n",
        "a.rs": "use crate::Thing;\nmod own;\n// use crate::c;\n",
        "a/own.rs": "use super::Parent;\n",
        "b.rs": "use crate::{c, error::{Kind, Why}};\npub fn f() { c::g() }\n",
        "c.rs": "#[cfg(test)]\nmod tests {\n    use crate::b::Thing;\n}\n",
    }
    (tmp_path / "a").mkdir()
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    assert needs(tmp_path) == {
        (): set(),
        ("a",): {("b",)},
        ("a", "own"): set(),
        ("b",): {("c",)},
        ("c",): set(),
    }
    TopologicalSorter(needs(tmp_path)).prepare()
    (tmp_path / "c.rs").write_text("pub fn g() { super::a::f() }\n", encoding="utf-8")
    with pytest.raises(CycleError) as found:
        TopologicalSorter(needs(tmp_path)).prepare()
    assert set(found.value.args[1]) == {("a",), ("b",), ("c",)}
