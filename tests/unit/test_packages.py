"""No two packages of ``tega`` import each other: a package that needs another is above it, and is not needed there."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from itertools import combinations
from pathlib import Path

import tega

ROOT = Path(tega.__file__).parent
PACKAGES = {path.parent.name for path in ROOT.glob("*/__init__.py")}


def needed(tree: ast.AST) -> Iterator[str]:
    """Return every module of the project that a file imports when it runs, also within functions."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"):
            continue
        if isinstance(node, ast.ImportFrom) and node.module == "tega":
            yield from (f"tega.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            yield node.module
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        yield from needed(node)


@cache
def imports(root: Path) -> dict[str, dict[str, list[str]]]:
    """Return which package imports which, and in which files."""
    found: dict[str, dict[str, list[str]]] = defaultdict(lambda: defaultdict(list))
    for path in sorted(root.glob("*/**/*.py")):
        own = path.relative_to(root).parts[0]
        for module in needed(ast.parse(path.read_text(encoding="utf-8"))):
            _, _, inner = module.partition("tega.")
            other = inner.partition(".")[0]
            if module.startswith("tega.") and other in PACKAGES and other != own:
                found[own][other].append(f"{path.relative_to(root)} imports {module}")
    return found


def circles(found: dict[str, dict[str, list[str]]]) -> dict[tuple[str, str], list[str]]:
    """Return the pairs that import each other, and the files of the direction with fewer of them."""
    return {
        (a, b): min(found[a][b], found[b][a], key=len)
        for a, b in combinations(sorted(found), 2)
        if b in found[a] and a in found[b]
    }


def test_no_two_packages_import_each_other() -> None:
    assert circles(imports(ROOT)) == {}, "move what both need below both"


def test_a_pair_would_be_found(tmp_path: Path) -> None:
    for own, other in (("arm", "net"), ("net", "arm")):
        (tmp_path / own).mkdir()
        (tmp_path / own / "one.py").write_text(f"def late():\n    from tega.{other}.two import x\n")
    assert circles(imports(tmp_path)) == {("arm", "net"): ["arm/one.py imports tega_link.two"]}


def test_the_records_and_the_bus_stand_below_everything() -> None:
    assert imports(ROOT).get("records", {}) == {}
    needs = set(needed(ast.parse((ROOT / "bus.py").read_text(encoding="utf-8"))))
    assert {module for module in needs if module.startswith("tega")} == {"tega.errors"}
