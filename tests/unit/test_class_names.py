"""A class's name is used once over the package and the tools: a reader who searches for it finds one."""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parents[2]
ROOTS = [PROJECT / name for name in ("python/tega", "tools/campaigns", "tools/emulators", "tools/figures")]


def defined(roots: list[Path]) -> dict[str, list[str]]:
    """Return where classes of each name are, inner ones as well."""
    found = defaultdict(list)
    for root in roots:
        for path in sorted(root.rglob("*.py")):
            if "build" in path.relative_to(root).parts:  # an installation's copy
                continue
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.ClassDef):
                    found[node.name].append(f"{path.relative_to(root)}:{node.lineno}")
    return found


@pytest.mark.skipif(not ROOTS[-1].is_dir(), reason="not a checkout")
def test_a_class_name_is_used_once() -> None:
    assert {name: places for name, places in defined(ROOTS).items() if len(places) > 1} == {}


def test_a_second_class_of_a_name_would_be_found(tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / f"{name}.py").write_text(
            "class Outer:\n    pass\n" if name == "one" else "class A:\n    class Outer: ...\n"
        )
    assert defined([tmp_path])["Outer"] == ["one.py:1", "two.py:2"]
