"""Every line of the hazard table names tests that exist."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parents[2]
PAGE = PROJECT / "docs" / "safety.md"

pytestmark = pytest.mark.skipif(not PAGE.is_file(), reason="not a checkout")


def rows() -> list[list[str]]:
    """Return the cells of the hazard table's lines."""
    text = PAGE.read_text(encoding="utf-8")
    table = text.split("## What can go wrong", 1)[1].split("\n## ", 1)[0]
    cells = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in table.splitlines()
        if line[:1] == "|"
    ]
    return cells[2:]


def test_there_is_a_table() -> None:
    assert len(rows()) > 20
    assert {len(row) for row in rows()} == {5}


@pytest.mark.parametrize("row", rows() if PAGE.is_file() else [], ids=lambda row: row[0])
def test_a_line_s_tests_exist(row: list[str]) -> None:
    assert all(row)
    named = re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", row[4])
    assert named
    for path, name in named:
        tree = ast.parse((PROJECT / path).read_text(encoding="utf-8"))
        assert name in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}, name


def test_every_hazard_test_is_in_the_table() -> None:
    listed = " ".join(row[4] for row in rows())
    for path in sorted((PROJECT / "tests" / "hazards").glob("test_*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
                assert f"{path.name}::{node.name}`" in listed
