"""Measure the grid of the simulated gel: time of a press against the distance from what a far finer grid shows."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega_figures.pareto.drawing import Choice, PricedVariant

__all__ = ["gel_grid"]

PROJECT: Final = Path(__file__).resolve().parents[4]
PLACE: Final = PROJECT / "target" / "gel-grids"
CRATES: Final = ("tega-gel", "tega-error", "tega-simd")
ROUNDS: Final = 3
LONG_PLAN: Final = "    Steps { matches: 4, most: 8, sweeps: 8, last: 12, relax: 1.0 },\n" * 3
PATIENT_PLAN: Final = "    Steps { matches: 20, most: 20, sweeps: 100, last: 4000, relax: 1.0 },\n" * 3
MANIFEST: Final = """[package]
name = "press"
version.workspace = true
edition.workspace = true
publish.workspace = true

[dependencies]
tega-gel.workspace = true
"""


class GridSize(NamedTuple):
    """Cells of the finest grid: pixels of one, all columns and rows, and those outside the picture on each side."""

    cell_px: int
    cols: int
    rows: int
    margin_cols: int
    margin_rows: int


SHIPPED: Final = GridSize(4, 96, 112, 18, 16)
# A grid's columns are a multiple of 32: the widths beside the picture differ a little.
COARSE: Final = GridSize(8, 64, 56, 17, 8)
FINE: Final = GridSize(2, 192, 224, 36, 32)
FINEST: Final = GridSize(1, 384, 448, 72, 64)
VARIANTS: Final[dict[str, tuple[GridSize, str | None]]] = {
    "8 px": (COARSE, None),
    "8 px, long plan": (COARSE, LONG_PLAN),
    "4 px": (SHIPPED, None),
    "4 px, long plan": (SHIPPED, LONG_PLAN),
    "2 px": (FINE, None),
    "2 px, long plan": (FINE, LONG_PLAN),
}
DEFAULT: Final = "4 px"


def _replaced(text: str, *pairs: tuple[str, str]) -> str:
    for what, instead in pairs:
        if text.count(what) != 1:
            raise SystemExit(f"{what!r} stands {text.count(what)} times in a file of tega-gel, wanted once")
        text = text.replace(what, instead)
    return text


def _plan(text: str, steps: str) -> str:
    head, start, rest = text.partition("const SCHEDULE: [Steps; 3] = [\n")
    return head + start + steps + rest[rest.index("];") :]


def _built(name: str, size: GridSize, steps: str | None, *, whole: bool = False) -> Path:
    """Build the program that presses with this grid; only the gel's crates are compiled."""
    tree = PLACE / name.replace(" ", "-").replace(",", "")
    files = {f"crates/{crate}/Cargo.toml": "" for crate in CRATES} | {"Cargo.toml": "", "Cargo.lock": ""}
    files |= {
        str(p.relative_to(PROJECT)): "" for c in CRATES for p in (PROJECT / "crates" / c / "src").iterdir()
    }
    files = {file: (PROJECT / file).read_text(encoding="utf-8") for file in files}
    src = "crates/tega-gel/src"
    files[f"{src}/grid.rs"] = _replaced(
        files[f"{src}/grid.rs"],
        *(
            (f"const {of}: usize = {was};", f"const {of}: usize = {now};")
            for of, was, now in zip(
                ("CELL_PX", "COLS", "ROWS", "MARGIN_COLS", "MARGIN_ROWS"), SHIPPED, size, strict=True
            )
        ),
    )
    membrane = files[f"{src}/membrane.rs"]
    if steps is not None:
        membrane = _plan(membrane, steps)
    if whole:
        membrane = _replaced(
            membrane,
            ("const ROOM: f32 = 1.5;", "const ROOM: f32 = 1e6;"),
            ("    rows: [MARGIN_ROWS - 2, ROWS - MARGIN_ROWS + 2],\n", "    rows: [0, ROWS],\n"),
            ("    cols: [MARGIN_COLS - 2, COLS - MARGIN_COLS + 2],\n", "    cols: [0, COLS],\n"),
        )
    files[f"{src}/membrane.rs"] = membrane
    if size != SHIPPED:
        # Painting has a grid of its own that goes with cells of 4 pixels; it is not asked for here.
        shares = "const SHARES: [[i16; 2]; CELL_PX]"
        lit = 'const _: () = assert!(LIT_ROWS + MARGIN_ROWS < ROWS, "every lit row has rows around it");\n'
        files[f"{src}/paint.rs"] = _replaced(
            files[f"{src}/paint.rs"], (shares, "const SHARES: [[i16; 2]; 4]"), (lit, "")
        )
    files["crates/press/Cargo.toml"] = MANIFEST
    files["crates/press/src/main.rs"] = Path(__file__).with_name("gel_press.rs").read_text(encoding="utf-8")
    for file, text in files.items():
        path = tree / file
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
    command = ["cargo", "build", "--release", "--quiet", "--package", "press", "--offline"]
    subprocess.run(command, cwd=tree, check=True, env=_environment())
    return tree / "target" / "release" / "press"


def _environment() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if name != "CARGO_TARGET_DIR"} | {
        "RUSTFLAGS": "--cap-lints allow"
    }


class Pressed(NamedTuple):
    """Of each press its depth and the displacement of blocks of 8 pixels, millimetres; the mean time of one, µs."""

    depth_mm: NDArray[np.float64]
    map_mm: NDArray[np.float64]
    one_us: float


def _pressed(program: Path, seconds: float) -> Pressed:
    """Run a program that :func:`_built` made."""
    said = subprocess.run([program, str(seconds)], check=True, capture_output=True, text=True).stdout
    lines = said.splitlines()
    microseconds = float(lines.pop()) if seconds else float("nan")
    numbers = np.array([line.split() for line in lines], float)
    return Pressed(numbers[:, 0], numbers[:, 1:], microseconds)


def gel_grid(*, budget_s: float) -> Choice:
    """Measure every grid, in turns, each beside the same presses on cells of one pixel."""
    finest = _pressed(_built("finest", FINEST, PATIENT_PLAN, whole=True), 0.0)
    programs = {name: _built(name, size, steps) for name, (size, steps) in VARIANTS.items()}
    rounds_of: dict[str, list[Pressed]] = {name: [] for name in programs}
    for _ in range(ROUNDS):
        for name, program in programs.items():
            rounds_of[name].append(_pressed(program, budget_s / ROUNDS / len(programs)))
    variants = []
    for name, rounds in rounds_of.items():
        off = np.abs(rounds[0].map_mm - finest.map_mm).max(axis=1) / finest.map_mm.max(axis=1)
        depth_off = np.abs(rounds[0].depth_mm / finest.depth_mm - 1)
        variants.append(
            PricedVariant(
                name=name,
                cost=min(pressed.one_us for pressed in rounds),
                error=float(100 * off.mean()),
                beside={
                    "worst press, %": float(100 * off.max()),
                    "depth off, mean %": float(100 * depth_off.mean()),
                },
                default=name == DEFAULT,
            )
        )
    return Choice(
        title="Simulated gel: size of its cells",
        setting="no option: `CELL_PX` of the crate `tega-gel`, for which the command builds the crate again",
        cost="µs to solve a press",
        error="displacement off, % of the deepest",
        how=(
            "Thirty simulated presses on the `digit` gel: two balls, two bars and a block with 0.3, 1 and 3 N, in the "
            "middle and beside it, turned. The reference has cells of one pixel and thousands of sweeps. Displacements "
            "are compared as means over 8 x 8 pixels: of each press the largest difference, of these the mean. A long "
            "plan matches forces and sweeps four times as often."
        ),
        why=(
            "Cells of 4 pixels halve the error of 8 for some 12 µs a press. Cells of 2 pixels take two and a half "
            "times as long and, by the same plan, miss more: a sweep reaches a cell further, and there half as far. "
            "Only with the long plan do they gain, less than a point for twelve times the time, of a gel whose law is "
            "off by several percent (sim-touch.md)."
        ),
        variants=variants,
    )
