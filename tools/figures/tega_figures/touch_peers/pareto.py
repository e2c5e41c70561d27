"""Draw run time against error of the tracker over cell size, outline and left out frames, the default marked.

::

    TEGA_DATA=/path/to/recordings python -m tega_figures.touch_peers.pareto docs/images/touch-pareto.svg

The kernel has no option for the cells' size: this tree is built once for each with that constant replaced, into
``target/peers``. The other constants are those of the default. Time is a ratio to NumPy's or-reduce over frame and
baseline in the same run. Writes ``benches/touch_pareto.json``, the picture and the page's table; ``--tables`` leaves
the measuring out.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from tega.tactile import Outline
from tega.tactile.tracker import TouchTracker
from tega_figures.pareto.drawing import name_points
from tega_figures.touch_peers.other_build import PROJECT, Child, built
from tega_figures.touch_peers.readings import WITH_MEMORY, Image, Makes, PeerReading, Unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["drawn", "measured"]

RESULTS: Final = PROJECT / "benches" / "touch_pareto.json"
_CELLS: Final = "crates/tega-tactile/src/live/cells.rs"
_CONSTANT: Final = "const CELLS_PER_DIAGONAL: f64 = {:.1f};"
_DEFAULT: Final = 50.0
# Sides of 4, 6, 12 and 16 pixels at 240 x 320.
_OTHERS: Final = {4: 100.0, 6: 66.7, 12: 33.3, 16: 25.0}
# Noise of a cell of 8 x 8 pixels of a DIGIT, blue, green, red, and how it falls with the side: neighbours are alike.
_DIGIT: Final = (1.32, 0.65, 1.17)
_FALLS: Final = 0.75


def _maker(side: int, outline: Outline, every: int) -> Makes:
    """Return a tracker that is given every so many-th frame and says the same in between."""

    def make(unit: Unit) -> Any:
        prior = tuple(noise * (8 / side) ** _FALLS for noise in _DIGIT)
        followed = TouchTracker(
            unit.baseline, rate_hz=unit.rate_hz / every, noise=unit.noise or prior, outline=outline
        )
        last: PeerReading | None = None
        k = 0

        def read(frame: Image, dt_s: float | None = None) -> PeerReading:  # noqa: ARG001
            nonlocal last, k
            if last is None or k % every == 0:
                c = followed.update(frame)
                last = PeerReading(c.in_contact, c.eda, c.peak, followed.mask())
            k += 1
            return last

        return read

    return make


def measured(folder: str, side: int, outline: Outline, every: int) -> dict[str, Any]:
    """Return time and errors of one variant, with the extension that this process has.

    Args:
        folder: The recordings' ``digit``.
        side: Side of a cell at 240 x 320, pixels.
        outline: As for the tracker.
        every: Every so many-th frame is read.
    """
    from tega_figures.touch_peers.cost import costs
    from tega_figures.touch_peers.sets import SETS

    make = _maker(side, outline, every)
    WITH_MEMORY.append(make)
    figures = [
        f
        for name in ("digit_grasp_masks", "digit_ball_D20641", "wedge_force")
        for f in SETS[name](Path(folder), make)
    ]
    of = {(f.set, f.what): f.value for f in figures}
    felt = [(f.value, f.n) for f in figures if f.what.split(",")[0] in {"ball", "foam", "golf"}]
    time = {row["what"]: row["over_floor"] for row in costs(budget_s=2.0, outline=outline)["rows"]}
    return {
        "side": side,
        "outline": outline,
        "every": every,
        "rest": round(time["untouched"] / every, 2),
        "touched": round(time["a ball of 4 mm, 3 N"] / every, 2),
        "grasp_error": round(1 - of["digit_grasp_masks", "overlap, median"], 3),
        "ball_error": round(1 - of["digit_ball_D20641", "overlap, median"], 3),
        "missed": round(1 - sum(v * n for v, n in felt) / sum(n for _, n in felt), 3),
        "told_wrongly": round(max(of["wedge_force", "before"], of["wedge_force", "from 1.5 s after"]), 3),
        "rank_error": round(1 - of["wedge_force", "rank of force and peak, median clip"], 3),
    }


def _site(side: int) -> Path:
    """Return where the extension with such cells is: the default's is this tree's own."""
    if side not in _OTHERS:
        return PROJECT / "python"
    text = _CONSTANT.format(_DEFAULT), _CONSTANT.format(_OTHERS[side])
    return built(f"cells-{side}", replace={_CELLS: text})


def measure(folder: Path, sides: Sequence[int]) -> list[dict[str, Any]]:
    """Measure every variant with these sides of cells beside the default's, each build in its own process."""
    rows = []
    asked: dict[int, list[tuple[Outline, int]]] = {8: [("dent", n) for n in (1, 2, 3, 4)] + [("contact", 1)]}
    asked |= {side: [("dent", 1), ("contact", 1)] for side in sides}
    for side, variants in asked.items():
        child = Child(_site(side), "measured")
        try:
            rows += [child(str(folder), side, outline, every) for outline, every in variants]
        finally:
            child.close()
        click.echo(rows[-1], err=True)
    return rows


def label(row: dict[str, Any]) -> str:
    """Name a variant."""
    skipped = "" if row["every"] == 1 else f", one frame in {row['every']}"
    return f"{row['side']} px, {row['outline']}{skipped}"


def table(rows: list[dict[str, Any]]) -> str:
    """Make the table of the page."""
    head = ["cells, outline, frames", "at rest", "touched", "1 - overlap, grasps", "1 - overlap, balls",
            "missed, 0.6 N and more", "detected where nothing is", "1 - rank with force"]  # fmt: skip
    lines = [head, ["---"] * len(head)]
    for row in rows:
        name = f"**{label(row)}** (default)" if _default(row) else label(row)
        lines.append([
            name, f"{row['rest']:.2f}", f"{row['touched']:.2f}", f"{row['grasp_error']:.2f}",
            f"{row['ball_error']:.2f}",
            f"{100 * row['missed']:.1f} %", f"{100 * row['told_wrongly']:.1f} %", f"{row['rank_error']:.3f}",
        ])  # fmt: skip
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _default(row: dict[str, Any]) -> bool:
    return (row["side"], row["outline"], row["every"]) == (8, "dent", 1)


def drawn(rows: list[dict[str, Any]]) -> Figure:
    """Draw touched time against three errors, each variant named by its cells and left out frames."""
    import matplotlib as mpl

    mpl.rcParams |= {"svg.hashsalt": "tega", "svg.fonttype": "none"}  # letters, not outlines of each
    from matplotlib.figure import Figure

    errors = {"grasp_error": "1 − overlap with masks of grasps", "missed": "share missed, 0.6 N and more (wedge)",
              "rank_error": "1 − rank correlation with force (wedge)"}  # fmt: skip
    figure = Figure(figsize=(11, 4.6), layout="constrained")
    panels = figure.subplots(1, 3)
    for panel, (key, what) in zip(panels, errors.items(), strict=True):
        for row in rows:
            marker = "*" if _default(row) else "o" if row["every"] == 1 else "s"
            colour = "tab:red" if _default(row) else "tab:blue" if row["outline"] == "dent" else "tab:orange"
            panel.plot(row["touched"], row[key], marker, color=colour, markersize=13 if _default(row) else 6)
        panel.set_xscale("log", base=2)
        panel.xaxis.set_major_formatter("{x:g}")
        panel.set_xlabel("touched frame, times NumPy's or-reduce")
        panel.set_ylabel(what)
        panel.margins(0.15)
        panel.set_ylim(bottom=0)
    figure.suptitle(
        "Pixels a cell; 1/2: every second frame. Blue: outline dent, orange: contact. Star: the default",
        fontsize=9,
    )
    figure.draw_without_rendering()  # Labels are placed once the panels have their size.
    figure.set_layout_engine("none")
    for panel, key in zip(panels, errors, strict=True):
        name_points(panel, [(row["touched"], row[key], _short(row)) for row in rows])
    return figure


def _short(row: dict[str, Any]) -> str:
    return f"{row['side']}" + ("" if row["every"] == 1 else f", 1/{row['every']}")


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("picture", type=click.Path(path_type=Path))
@click.option(
    "--side", "sides", type=click.Choice([str(side) for side in _OTHERS]), multiple=True,
    help="Only this side of cells beside the default's, pixels; repeatable.",
)  # fmt: skip
@click.option("--tables", is_flag=True, help="Draw the committed figures; measure nothing.")
def main(picture: Path, *, sides: tuple[str, ...], tables: bool) -> None:
    """Measure unless told not to; draw, and write the page's table."""
    from tega_figures.touch_peers.__main__ import PAGE, page

    if not tables:
        rows = measure(
            Path(os.environ.get("TEGA_DATA", "../shared/data")) / "digit",
            [int(side) for side in sides or _OTHERS],
        )
        RESULTS.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    rows = json.loads(RESULTS.read_text(encoding="utf-8"))
    drawn(rows).savefig(picture, metadata={"Date": None} if picture.suffix == ".svg" else None)
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8"), {"pareto": table(rows)}), encoding="utf-8")


if __name__ == "__main__":
    main()
