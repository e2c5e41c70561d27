"""Draw changes of the code: of Python by cosmic-ray's operators, of Rust by cargo-mutants."""

from __future__ import annotations

import ast
import json
import random
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import msgspec

HOT_PYTHON: Final = (
    "devices/hand/hand_bus.py",
    "devices/hand/hand_loop.py",
    "devices/vest/vest_stream.py",
    "hand",
    "loop",
    "records/schema.py",
    "records/table.py",
    "safety",
    "stages/columns.py",
    "stages/decoders.py",
    "stages/equal_steps.py",
    "stages/events/detector.py",
    "stages/metrics.py",
    "stages/pulses.py",
    "wire",
)
"""Modules and packages of ``tega`` that run at every tick of a session."""

HOT_RUST: Final = ("emg", "gel", "hand", "haptics", "image", "serial", "simd", "tactile", "wire")
"""Crates ``tega-…`` of kernels, filters, controllers and packets."""

OTHER_PROCESSOR: Final = "neon.rs"
"""Ends the name of a file that is compiled for arm64 alone."""


class Mutant(msgspec.Struct, frozen=True):
    """A change of the code in one place.

    Attributes:
        file: The file, from the project's folder.
        line: Its line, from 1.
        package: The crate; ``""`` for Python.
        code: The changed file, for Python.
        diff: The change as a patch, for Rust.
    """

    name: str
    file: str
    line: int
    package: str = ""
    code: str = ""
    diff: str = ""


def python_mutants(tree: Path, seed: int) -> Iterator[Mutant]:
    """Return changes of the hot paths in Python, in the order of the draw.

    Left out are changes that are no Python, and what Python does not evaluate: the unions in annotations, and what
    stands under ``TYPE_CHECKING``.
    """
    from cosmic_ray.ast import ast_nodes, get_ast_from_path
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator, operator_names

    # Operators that need an argument for what to replace are left out.
    operators = {
        name: get_operator(name)() for name in operator_names() if not get_operator(name).arguments()
    }
    found: list[tuple[str, str, int, int]] = []
    for hot in HOT_PYTHON:
        path = tree / "python" / "tega" / hot
        for file in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            unread, nodes = _unread(file), list(ast_nodes(get_ast_from_path(file)))
            name = file.relative_to(tree).as_posix()
            for kind, operator in operators.items():
                places = (place for node in nodes for place, _ in operator.mutation_positions(node))
                found += [
                    (name, kind, number, place[0])
                    for number, place in enumerate(places)
                    if not _is_unread(kind, place, unread)
                ]
    found.sort()
    random.Random(seed).shuffle(found)
    for name, kind, number, line in found:
        before = (tree / name).read_text()
        after = mutate_code(before, operators[kind], number)
        if after is not None and after != before and _is_python(after):
            yield Mutant(f"{name}:{line}: {kind.partition('/')[2]} {number}", name, line, code=after)


def rust_mutants(tree: Path, seed: int) -> Iterator[Mutant]:
    """Return changes of the hot paths in Rust, in the order of the draw."""
    packages = [word for crate in HOT_RUST for word in ("-p", f"tega-{crate}")]
    command = ["cargo", "mutants", "--list", "--json", "--diff", "--no-config", *packages]
    listed = json.loads(subprocess.run(command, cwd=tree, check=True, capture_output=True, text=True).stdout)
    found = sorted(
        (one for one in listed if not one["file"].endswith(OTHER_PROCESSOR)), key=lambda one: str(one["name"])
    )
    random.Random(seed).shuffle(found)
    for one in found:
        yield Mutant(
            one["name"], one["file"], one["span"]["start"]["line"], package=one["package"], diff=one["diff"]
        )


def _is_python(code: str) -> bool:
    """Whether a changed module can be compiled: the star of a signature is no multiplication."""
    try:
        ast.parse(code)
    except SyntaxError:
        return False
    return True


def _unread(file: Path) -> tuple[list[ast.expr], set[int]]:
    """Return the annotations of a module, and the lines that only a type checker reads."""
    annotations: list[ast.expr] = []
    lines: set[int] = set()
    for node in ast.walk(ast.parse(file.read_text())):
        parts = (getattr(node, name, None) for name in ("annotation", "returns"))
        annotations += [part for part in parts if isinstance(part, ast.expr)]
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            lines |= set(range(node.lineno, (node.body[-1].end_lineno or 0) + 1))
    return annotations, lines


def _is_unread(kind: str, place: tuple[int, int], unread: tuple[list[ast.expr], set[int]]) -> bool:
    annotations, lines = unread
    within = (
        (one.lineno, one.col_offset) <= place <= (one.end_lineno or 0, one.end_col_offset or 0)
        for one in annotations
    )
    return place[0] in lines or ("BitOr" in kind and any(within))
