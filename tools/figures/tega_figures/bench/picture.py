"""The picture of a run: time against error, one panel a question."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from tega.ui.view.figures import new_figure
from tega_figures.bench.report import BILINEAR, FLOOR, BenchReport, ContactRow
from tega_figures.bench.scenes import SIZE_OF_A_FINGER
from tega_figures.bench.variants import CONTACT_LAWS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tega_figures.bench.widths import WidthRow

__all__ = ["draw_pareto"]

OURS, PEERS, LINE = "#c8202f", "#1f5fbf", "#9aa0a6"
KERNELS = ("#c8202f", "#e08214", "#762a83", "#1b7837", "#1f5fbf")
# Where an error of exactly 0, or one too small for double precision, is drawn.
LEAST_ERROR = 1e-17
# The two laws of the largest share of uses; the signed one is the print, and its sums nearly cancel.
SHOWN = (CONTACT_LAWS[0], CONTACT_LAWS[1])


class Point(NamedTuple):
    """One variant in a panel."""

    name: str
    time_us: float
    error: float


def draw_pareto(path: Path, report: BenchReport) -> None:
    """Write the picture of a run as PNG."""
    figure = new_figure(figsize=(20, 5))
    panels = figure.subplots(1, len(SHOWN) + 2)
    for ax, law in zip(panels, SHOWN, strict=False):
        rows = [r for r in report.contact if r.size == SIZE_OF_A_FINGER and r.reading == law.name]
        points = [
            Point(r.variant, r.time.median_us, _error(r))
            for r in rows
            if r.error is not None and r.variant != BILINEAR
        ]
        _draw(
            ax,
            points,
            f"contact metrics, {law.name}, 320×240",
            "largest of: centroid / px, relative σ and CCI",
        )
        floor = next(r for r in rows if r.variant == FLOOR)
        ax.axvline(floor.time.median_us, color=LINE, ls="--", lw=1)
        ax.annotate(
            FLOOR,
            (floor.time.median_us, 0.97),
            xycoords=("data", "axes fraction"),
            xytext=(4, 0),
            textcoords="offset points",
            fontsize=8,
            color=LINE,
            va="top",
        )
    block = [r for r in report.emg if r.case == "block"]
    points = [Point(r.variant, r.time.median_us, r.error_of_full_scale or 0.0) for r in block]
    _draw(panels[-2], points, "low-pass of 3 channels, 10 samples", "largest error / full scale")
    _draw_widths(panels[-1], report.widths)
    figure.suptitle(
        f"{report.machine.cpu}, {report.machine.instruction_set}, one thread: median time of a call from Python",
        fontsize=9,
    )
    figure.savefig(path, metadata={"Software": None})


def _draw_widths(ax: Axes, rows: Sequence[WidthRow]) -> None:
    """Draw each kernel's time over the or-reduce's, a line an orientation and layout."""
    shapes = {"-": (False, True), "--": (False, False), ":": (True, True)}
    for kernel, color in zip(rows[0].to_floor, KERNELS, strict=True):
        for style, (strided, upright) in shapes.items():
            there = [r for r in rows if (r.strided, r.size[0] > r.size[1]) == (strided, upright)]
            ratios = [r.to_floor[kernel] for r in there]
            ax.plot(
                [r.size[1] for r in there], ratios, style, color=color, label=kernel if style == "-" else None
            )
    ax.set_yscale("log", base=2)
    ax.yaxis.set_major_formatter("{x:g}")
    ax.set_xlabel("width, pixels (solid upright, dashed lying, dotted with rows apart)", fontsize=9)
    ax.set_ylabel("time over NumPy's or-reduce of both images", fontsize=9)
    ax.set_title("every width", fontsize=10)
    ax.grid(visible=True, which="major", color="#e6e6e6", lw=0.6)
    ax.legend(fontsize=8)


def _error(row: ContactRow) -> float:
    error = row.error
    return 0.0 if error is None else max(error.centroid_px, error.spread_relative, error.cci_relative)


def _draw(ax: Axes, points: Sequence[Point], title: str, label: str) -> None:
    for point in points:
        ours = point.name.startswith("TEGA")
        at = (point.time_us, max(point.error, LEAST_ERROR))
        ax.scatter(
            *at, color=OURS if ours else PEERS, marker="*" if ours else "o", s=110 if ours else 36, zorder=3
        )
        ax.annotate(
            point.name,
            at,
            xytext=(0, -16 if ours else 7),
            textcoords="offset points",
            ha="center",
            fontsize=8,
        )
    front = [p for p in points if not any(q.time_us < p.time_us and q.error <= p.error for q in points)]
    front.sort(key=lambda p: p.time_us)
    steps = [(p.time_us, max(p.error, LEAST_ERROR)) for p in front]
    ax.step(*zip(*steps, strict=True), where="post", color=LINE, lw=1, zorder=1)
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.margins(x=0.2, y=0.15)
    ax.set_xlabel("µs (left is faster)", fontsize=9)
    ax.set_ylabel(f"{label} (down is better)", fontsize=9)
    ax.set_title(title, fontsize=10)
    ax.grid(visible=True, which="major", color="#e6e6e6", lw=0.6)
