"""Every line of the hazard table names tests that exist."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parents[2]
PAGE = PROJECT / "docs" / "evidence" / "safety.md"

# Their tests move the clock themselves, or read the emulated devices' stamps.
CLOCKS = (
    "tests/hazards/test_times.py",
    "tests/hazards/test_stamps.py",
    "tests/hazards/test_letting_go.py",
    "tests/tega/unit/test_arm.py",
    "tests/tega/unit/test_picture_votes.py",
)

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


def times_unproven(row: list[str]) -> bool:
    """Tell whether a line states a time that no test on a clock of its own, or on the devices' stamps, holds."""
    states = re.search(r"\d m?s\b", row[2])
    return bool(states) and not any(f"`{module}::" in row[4] for module in CLOCKS)


@pytest.mark.parametrize("row", rows() if PAGE.is_file() else [], ids=lambda row: row[0])
def test_a_line_that_states_a_time_names_a_test_of_it(row: list[str]) -> None:
    assert not times_unproven(row)


def test_a_time_without_a_test_of_it_is_seen() -> None:
    proven = ["a", "b", "0.5 s", "d", "`tests/hazards/test_times.py::test_x`, `tests/unit/test_y.py::test_y`"]
    assert not times_unproven(proven)
    assert times_unproven([*proven[:4], "`tests/unit/test_y.py::test_y`"])
    assert times_unproven([*proven[:2], "[30 ms](page.md)", "d", "`tests/unit/test_y.py::test_y`"])
    assert not times_unproven([*proven[:2], "at once", "d", "`tests/unit/test_y.py::test_y`"])


def test_every_hazard_test_is_in_the_table() -> None:
    listed = " ".join(row[4] for row in rows())
    for path in sorted((PROJECT / "tests" / "hazards").glob("test_*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
                assert f"{path.name}::{node.name}`" in listed
