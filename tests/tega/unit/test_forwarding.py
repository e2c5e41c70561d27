"""No class only forwards to another of its own interface: who wants to see what passes subscribes to the bus."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import tega

ROOT = Path(tega.__file__).parent
_Function = ast.FunctionDef | ast.AsyncFunctionDef


def forwarded(function: _Function) -> str:
    """Return the attribute to whose method of the same name a method does nothing but pass its call on."""
    body = [
        node
        for node in function.body
        if not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant))
    ]
    if len(body) != 1 or not isinstance(body[0], (ast.Return, ast.Expr)):
        return ""
    value = body[0].value
    if isinstance(value, ast.Await):
        value = value.value
    if isinstance(value, ast.Call):
        value = value.func
    if not isinstance(value, ast.Attribute) or value.attr != function.name:
        return ""
    inner = value.value
    mine = isinstance(inner, ast.Attribute) and isinstance(inner.value, ast.Name) and inner.value.id == "self"
    return inner.attr if mine and isinstance(inner, ast.Attribute) else ""


def face_of_a_kernel(node: ast.ClassDef) -> bool:
    """Whether a class is how Python sees an object of Rust: it makes that itself, and gives it docstrings and types."""
    return "_native." in "".join(
        ast.unparse(one) for one in node.body if isinstance(one, _Function) and one.name == "__init__"
    )


def forwarding(tree: ast.AST) -> Iterator[str]:
    """Return the classes of a file that do nothing themselves."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.ClassDef) or face_of_a_kernel(node):
            continue
        methods = [
            one
            for one in node.body
            if isinstance(one, _Function) and one.name not in {"__init__", "__enter__", "__exit__"}
        ]
        if (
            methods
            and len({forwarded(method) for method in methods} - {""}) == 1
            and all(map(forwarded, methods))
        ):
            yield node.name


@pytest.mark.parametrize(
    "package", sorted({path.parent for path in ROOT.rglob("*.py")}), ids=lambda p: p.name
)
def test_no_class_only_forwards(package: Path) -> None:
    found = [
        f"{path.relative_to(ROOT)}: {name}"
        for path in sorted(package.glob("*.py"))
        for name in forwarding(ast.parse(path.read_text(encoding="utf-8")))
    ]
    assert found == [], "let whoever wants to see what passes subscribe, or use the other object itself"


def test_one_that_does_would_be_found() -> None:
    tap = (
        "class Tap:\n"
        "    def __init__(self, inner):\n        self._inner = inner\n"
        "    @property\n    def info(self):\n        return self._inner.info\n"
        "    def read(self, timeout_s):\n        '''Read.'''\n        return self._inner.read(timeout_s)\n"
        "    def close(self):\n        self._inner.close()\n"
    )
    assert list(forwarding(ast.parse(tap))) == ["Tap"]
    assert not list(forwarding(ast.parse(tap + "    def open(self):\n        self.n = 1\n")))
