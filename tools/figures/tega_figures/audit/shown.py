"""Show an audit: its tables on the terminal, and pictures of what each reading takes for the contact.

The pictures have the contact's outline, and how the numbers go over pictures or over a sweep.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from tega.errors import InvalidValueError
from tega.ui.view.figures import new_figure
from tega_figures.audit import AuditReport, EmgScore, FingerAudit, Mark, TouchScore, VestScore

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tega_figures.audit import AuditReport

__all__ = ["draw_audit", "draw_courses", "draw_sweep"]

MARK_YELLOW, AREA_BLUE = "#ffd23f", "#3b8cff"

# What a sweep draws, by what it is of: name of the field, and what stands at the axis.
_SWEPT: dict[type, tuple[tuple[str, str], ...]] = {
    TouchScore: (
        ("n_found", "pictures with contact"),
        ("eda", "median EDA, pixels"),
        ("cci", "median CCI"),
        ("area_ratio", "area / mark"),
        ("iou", "overlap with mark"),
        ("n_felt", "touched and felt"),
        ("n_false", "untouched and felt"),
        ("force_rank", "rank r, EDA with force"),
        ("cci_force_rank", "rank r, CCI with force"),
    ),
    EmgScore: (
        ("level_shares", "mean level, 1 to 5"),
        ("changes_per_s", "changes per second"),
        ("later_s", "later than the first, s"),
        ("agreement", "same level as the first"),
        ("force_rank", "rank r, level with force"),
    ),
    VestScore: (
        ("lit_share", "share of frames with a motor on"),
        ("front_mean", "front, mean percent"),
        ("back_mean", "back, mean percent"),
        ("full_share", "share of motors at 95 and more"),
        ("flips_per_s", "flips per second"),
        ("force_rank", "rank r, sum with force"),
    ),
}


def draw_audit(path: Path, seen: FingerAudit, scores: Sequence[TouchScore]) -> None:
    """Draw as PNG what each reading takes for contact in the clearest picture, and its area over all of them.

    ``scores`` are one a reading, of this finger.
    """
    if seen.displayed is None:
        raise InvalidValueError("no picture was measured", "audit a recording of touch")
    figure = new_figure(figsize=(1.5 * len(scores) + 1, 7.5))
    upper, lower = figure.subfigures(2, 1, height_ratios=[1.2, 1], squeeze=False)[:, 0]
    for ax, score in zip(upper.subplots(1, len(scores), squeeze=False)[0], scores, strict=True):
        _draw_mask(ax, seen.displayed, seen.areas.get(score.reading), score.reading)
        if seen.mark is not None:
            _draw_mark(ax, seen.mark)
    ax = lower.subplots()
    n_pixels = seen.baseline.shape[0] * seen.baseline.shape[1]
    for score in scores:
        ax.plot(np.array(score.eda) / n_pixels, marker=".", lw=1, label=score.reading)
    if seen.mark is not None:
        discs = [np.nan if t.mark is None else np.pi * t.mark.radius_px**2 / n_pixels for t in seen.truths]
        ax.plot(discs, color=MARK_YELLOW, lw=3, zorder=0, label="marked circle")
    ax.set_xlabel("picture")
    ax.set_ylabel("EDA, share of the picture")
    ax.set_ylim(-0.02, 1.05)
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8, frameon=False)
    figure.savefig(path, metadata={"Software": None})


def draw_courses(path: Path, report: AuditReport) -> None:
    """Draw the levels of every EMG reading and the sum of intensities of every vest reading over time."""
    kinds = [scores for scores in (report.emg, report.vest) if scores]
    if not kinds:
        raise InvalidValueError("the report has no course over time", "audit --of emg or vest")
    figure = new_figure(figsize=(9, 3.4 * len(kinds)))
    for ax, scores in zip(figure.subplots(len(kinds), 1, squeeze=False)[:, 0], kinds, strict=True):
        for score in scores:
            if isinstance(score, EmgScore):
                ax.step(score.t_s, score.levels, where="post", lw=1, label=score.reading)
            else:
                ax.plot(score.total, lw=1, label=score.reading)
        emg = isinstance(scores[0], EmgScore)
        ax.set_xlabel("s" if emg else "vest frame")
        ax.set_ylabel("closure level, 1 to 5" if emg else "sum over the motors, percent")
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8, frameon=False)
    figure.savefig(path, metadata={"Software": None})


def draw_sweep(path: Path, report: AuditReport) -> None:
    """Draw every score of a sweep over the swept setting as PNG: a panel a score, a line a finger."""
    panels = [
        (scores, name, label)
        for scores in (report.touch, report.emg, report.vest)
        if scores
        for name, label in _SWEPT[type(scores[0])]
        if any(_value(score, name) is not None for score in scores)
    ]
    if not report.sweep or not panels:
        raise InvalidValueError("the report is of no sweep", "give --sweep KEY=FROM:TO:STEP")
    columns = min(3, len(panels))
    rows = -(-len(panels) // columns)
    figure = new_figure(figsize=(3.2 * columns, 2.4 * rows))
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    figure.suptitle(f"{report.recording}: {report.sweep}", fontsize=9)
    for ax, (scores, name, label) in zip(axes, panels, strict=False):
        for finger in dict.fromkeys(getattr(score, "finger", "") for score in scores):
            own = [score for score in scores if getattr(score, "finger", "") == finger]
            y = [np.nan if (number := _value(score, name)) is None else number for score in own]
            ax.plot([score.value for score in own], y, marker=".", lw=1, label=finger)
        ax.set_title(label, fontsize=8)
        ax.set_xlabel(report.sweep.rpartition(".")[2], fontsize=8)
        ax.tick_params(labelsize=7)
        if len(ax.lines) > 1:
            ax.legend(fontsize=7, frameon=False)
    for ax in axes[len(panels) :]:
        ax.set_axis_off()
    figure.savefig(path, metadata={"Software": None})


def _value(score: Any, name: str) -> float | None:
    """Return a score as one number."""
    value = getattr(score, name)
    if name == "level_shares":
        return float(np.dot(value, range(1, 6)))
    if isinstance(value, list):
        return float(np.median(value)) if value else None
    return None if value is None else float(value)


def _draw_mask(ax: Axes, frame: NDArray[np.uint8], mask: NDArray[np.bool_] | None, reading: str) -> None:
    ax.imshow(frame[..., ::-1])
    if mask is not None:
        tint = np.zeros((*mask.shape, 4))
        tint[mask] = (1.0, 1.0, 1.0, 0.35)
        ax.imshow(tint)
        if mask.any() and not mask.all():
            ax.contour(mask, levels=[0.5], colors=[AREA_BLUE], linewidths=1.2)
    ax.set_xticks([])
    ax.set_yticks([])
    ax.set_title(reading.replace(", ", ",\n").replace(" (", "\n("), fontsize=8)


def _draw_mark(ax: Axes, mark: Mark) -> None:
    angle = np.linspace(0, 2 * np.pi, 200)
    x, y = mark.centre_xy
    ax.plot(x + mark.radius_px * np.cos(angle), y + mark.radius_px * np.sin(angle), color=MARK_YELLOW, lw=1.2)
    ax.set_xlim(-0.5, ax.get_images()[0].get_array().shape[1] - 0.5)  # type: ignore[union-attr]
    ax.set_ylim(ax.get_images()[0].get_array().shape[0] - 0.5, -0.5)  # type: ignore[union-attr]


_Column = tuple[str, Callable[[Any], str | None]]


def _number(name: str, form: str = ".2f") -> Callable[[Any], str | None]:
    def reported(score: Any) -> str | None:
        value = getattr(score, name)
        return None if value is None else f"{value:{form}}"

    return reported


def _area(place: Callable[[list[int]], int]) -> Callable[[Any], str | None]:
    return lambda score: str(sorted(score.eda)[place(score.eda)]) if score.eda else None


_TOUCH: tuple[_Column, ...] = (
    ("found", lambda s: f"{s.n_found} of {s.n_frames}"),
    ("EDA least", _area(lambda _all: 0)),
    ("median", _area(lambda all_: len(all_) // 2)),
    ("most", _area(lambda _all: -1)),
    ("changes/s", _number("changes_per_s")),
    ("at rest", _number("eda_at_rest", "d")),
    ("area / mark", _number("area_ratio")),
    ("overlap", _number("iou")),
    ("worst tenth", _number("iou_low")),
    ("r with mark", _number("area_correlation")),
    ("felt", lambda s: None if s.n_touched is None else f"{s.n_felt} of {s.n_touched}"),
    ("false", _number("n_false", "d")),
    ("EDA with N", _number("force_rank")),
    ("CCI with N", _number("cci_force_rank")),
)

_EMG: tuple[_Column, ...] = (
    ("blocks", _number("n_blocks", "d")),
    ("share at 1 … 5", lambda s: " ".join(f"{100 * share:.0f}" for share in s.level_shares) + " %"),
    ("changes/s", _number("changes_per_s")),
    ("later ms", lambda s: None if s.later_s is None else f"{1000 * s.later_s:.0f}"),
    ("same level", lambda s: f"{100 * s.agreement:.0f} %"),
    ("muted", _number("n_muted", "d")),
    ("r with N", _number("force_rank")),
    ("maxima of", lambda s: str(s.maxima_of)),
)

_VEST: tuple[_Column, ...] = (
    ("layout", lambda s: str(s.layout)),
    ("frames lit", lambda s: f"{100 * s.lit_share:.0f} %"),
    ("front %", _number("front_mean", ".0f")),
    ("back %", _number("back_mean", ".0f")),
    ("full", lambda s: f"{100 * s.full_share:.0f} %"),
    ("flips/s", _number("flips_per_s")),
    ("steps", _number("n_steps", "d")),
    ("r with N", _number("force_rank")),
    ("maxima of", lambda s: str(s.maxima_of)),
)


def print_report(report: AuditReport) -> None:
    """Print a table for touch, EMG and vest each, where the report has it."""
    console = Console(highlight=False, width=150)
    for subject, scores, columns in (
        ("touch", report.touch, _TOUCH),
        ("EMG", report.emg, _EMG),
        ("vest", report.vest, _VEST),
    ):
        if scores:
            console.print(
                _table(f"{report.recording}: {subject}", report.sweep or "reading", scores, columns)
            )
    if report.n_left_out:
        console.print(f"{report.n_left_out} pictures left out: marks, masks or forces say nothing of them.")


def _table(title: str, first: str, scores: Sequence[Any], columns: Sequence[_Column]) -> Table:
    table = Table(title=title, title_justify="left", box=SIMPLE)
    several = len({getattr(score, "finger", "") for score in scores}) > 1
    table.add_column(first.rpartition("options.")[2], no_wrap=True)
    if several:
        table.add_column("finger")
    displayed = [
        (name, reported) for name, reported in columns if any(reported(score) is not None for score in scores)
    ]
    for name, _ in displayed:
        table.add_column(name, justify="right")
    for score in scores:
        row = [score.reading, *([score.finger] if several else [])]
        table.add_row(*row, *(reported(score) or "–" for _, reported in displayed))
    return table
