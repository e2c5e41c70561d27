"""Draw an audit: what each reading takes for the contact, and how its numbers go over pictures or over a sweep."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tega.errors import InvalidValueError
from tega.ui.view.figures import new_figure
from tega_figures.audit import AuditReport, EmgScore, FingerAudit, Mark, TouchScore, VestScore

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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
        if any(_number(score, name) is not None for score in scores)
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
            y = [np.nan if (number := _number(score, name)) is None else number for score in own]
            ax.plot([score.value for score in own], y, marker=".", lw=1, label=finger)
        ax.set_title(label, fontsize=8)
        ax.set_xlabel(report.sweep.rpartition(".")[2], fontsize=8)
        ax.tick_params(labelsize=7)
        if len(ax.lines) > 1:
            ax.legend(fontsize=7, frameon=False)
    for ax in axes[len(panels) :]:
        ax.set_axis_off()
    figure.savefig(path, metadata={"Software": None})


def _number(score: Any, name: str) -> float | None:
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
