"""Count the wiring again: wrappers of the loop, kinds of stream, files of TEGA that a stage of one's own touches."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator
from pathlib import Path

import pytest

import tega
from tega.loop import DualLoop, run_session

PACKAGE = Path(tega.__file__).parent
EXAMPLES = Path(__file__).resolve().parents[3] / "examples"


def classes(*where: str) -> Iterator[tuple[str, ast.ClassDef]]:
    for place in where:
        root = PACKAGE / place
        for file in sorted(root.rglob("*.py") if root.is_dir() else [root]):
            for node in ast.walk(ast.parse(file.read_text("utf-8"))):
                if isinstance(node, ast.ClassDef):
                    yield str(file.relative_to(PACKAGE)), node


def test_the_loop_and_a_run_take_few_parameters() -> None:
    assert len(inspect.signature(DualLoop).parameters) <= 12
    assert len(inspect.signature(run_session).parameters) <= 8


def test_there_are_two_kinds_of_stream() -> None:
    # Whatever gives the loop stamped items has this method.
    streams = {
        node.name: [ast.unparse(base) for base in node.bases]
        for _, node in classes("")
        if any(isinstance(one, ast.FunctionDef) and one.name == "next_until" for one in node.body)
    }
    protocols = [
        name for name, bases in streams.items() if any(base.startswith("Protocol") for base in bases)
    ]
    assert sorted(set(streams) - set(protocols)) == ["LiveStream", "PulledStream"]
    assert protocols == ["Stream"]


@pytest.mark.skipif(not EXAMPLES.is_dir(), reason="not a checkout")
@pytest.mark.parametrize("example", ["own_metric", "own_decoder", "own_mapping", "own_layout", "own_device"])
def test_a_stage_or_device_of_one_s_own_touches_no_file_of_tega(example: str) -> None:
    files = sorted((EXAMPLES / example / "src").rglob("*.py"))
    assert files
    touching = [file.name for file in PACKAGE.rglob("*.py") if example in file.read_text("utf-8")]
    assert touching == []
    for file in files:
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            names = (
                [alias.name for alias in node.names] if isinstance(node, (ast.Import, ast.ImportFrom)) else []
            )
            module = (node.module or "") if isinstance(node, ast.ImportFrom) else ""
            if module.startswith("tega") or any(name.startswith("tega") for name in names):
                private = [
                    part for name in (module, *names) for part in name.split(".") if part.startswith("_")
                ]
                assert private == [], f"{file.name} imports {module} {names}"
