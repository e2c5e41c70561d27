"""The guards of the hazard table stand where they can be taken out, and every alert is raised by a test."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from hazards.guards import Guard
from hazards.without import EVERY, GUARDS, read_page

PROJECT = Path(__file__).resolve().parents[2]
PAGE = PROJECT / "docs/evidence/safety.md"
# What declares and raises alerts; a file without any of these is not parsed.
SIGNS = re.compile(r"def (alerts|needs|watch_over)\(|\b(watch|alert)\(")


@pytest.fixture(scope="module")
def program() -> str:
    return "\0".join(file.read_text(encoding="utf-8") for file in (PROJECT / "python").rglob("*.py"))


@pytest.mark.parametrize("guard", EVERY, ids=lambda guard: guard.what)
def test_every_guard_stands_where_it_can_be_taken_out_and_the_page_has_it(guard: Guard, program: str) -> None:
    assert program.count(guard.old) == 1
    file, _, test = guard.shown_by.partition("::")
    assert f"def {test.split('[')[0]}(" in (PROJECT / file).read_text(encoding="utf-8")
    # What is unproven, on a machine that was busy, stands there as such; what survives is a hole.
    assert "SURVIVES" not in read_page()[guard.what, guard.shown_by][3]


def test_every_line_of_the_hazard_table_has_a_guard() -> None:
    named = re.findall(r"`(tests/\w+/test_\w+\.py::[^`]+)` \|$", PAGE.read_text(encoding="utf-8"), re.M)
    displayed = {name.split("[")[0] for name in named}
    assert len(displayed) > 20
    assert not displayed - {guard.shown_by.split("[")[0] for guard in GUARDS}


def _keys(node: ast.AST) -> Iterator[str]:
    """Return the names under which a part of the code puts something into a table."""
    for one in ast.walk(node):
        keys: list[ast.expr | None] = []
        if isinstance(one, ast.Dict):
            keys = list(one.keys)
        elif isinstance(one, ast.Subscript) and isinstance(one.ctx, ast.Store):
            keys = [one.slice]
        elif isinstance(one, ast.Call) and ast.unparse(one.func) == "Watched":
            keys = [key for key in one.args[:1] if isinstance(key, ast.Constant)]
        for key in keys:
            assert isinstance(key, ast.Constant), f"line {one.lineno}: {ast.unparse(one)}"  # type: ignore[attr-defined]
            yield str(key.value)


def declared() -> set[str]:
    """Return the names by which a guard alerts: what it watches, in the core and in the parts of features."""
    found = {"thumb"}  # of the fingers, which are watched alike
    texts = [file.read_text(encoding="utf-8") for file in (PROJECT / "python").rglob("*.py")]
    for text in filter(SIGNS.search, texts):
        found.update(re.findall(r'\b(?:watch|alert)\(\s*"(.+?)"', text))
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef) and node.name in {"alerts", "needs", "watch_over"}:
                found.update(_keys(node))
    return found


def test_every_alert_has_a_test_that_raises_it() -> None:
    texts = (file.read_text() for file in (PROJECT / "tests").rglob("test_*.py"))
    assert declared() == {
        name for text in texts for name in re.findall(r'pytest\.mark\.raises\("(.+?)"\)', text)
    }
