"""Draw the paper's figures from an analysis, and those it lacks, as SVG; equal analyses give equal bytes."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tega.runtime.lifecycle import require
from tega_study.analyse import Analysis
from tega_study.coupling import TouchCourse, on_grid

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


CCI_BLUE, EDA_GREEN, POSE_RED = "#0072B2", "#009E73", "#c8202f"
ARMS = ("#56B4E9", "#E69F00", "#999999", "#CC79A7", "#009E73", "#F0E442", "#0072B2", "#D55E00")
MEAN_RED = "#c8202f"
FIG_8_ROWS = 3
VIOLIN_FROM = 6
"""Values from which a violin is drawn."""


def p_text(p: float | None) -> str:
    """Write a p-value as the paper does.

    Example:
        >>> p_text(0.0140193), p_text(0.0002), p_text(None)
        ('p = 0.014', 'p < 0.001', 'p: –')
    """
    if p is None:
        return "p: –"
    return "p < 0.001" if p < 0.001 else f"p = {p:.3f}"


def new_figure(width_in: float, height_in: float) -> Figure:
    """Return an empty figure; ``MissingExtraError`` without matplotlib."""
    figures: Any = require("matplotlib.figure", driver="study report", extra="study")
    figure: Figure = figures.Figure(figsize=(width_in, height_in), layout="constrained")
    return figure


def svg(figure: Figure) -> str:
    """Write a figure as SVG without date, with ids that depend on the drawing alone, and text as text."""
    import matplotlib as mpl

    options: dict[Any, Any] = {"svg.hashsalt": "tega", "svg.fonttype": "none", "font.family": "sans-serif"}
    out = io.StringIO()
    with mpl.rc_context(options):
        figure.savefig(out, format="svg", metadata={"Date": None, "Creator": None})
    return out.getvalue()


def figure_7(analysis: Analysis) -> Figure:
    """Draw Fig 7: completion time over slips, a column an object; violins, a dot a trial, diamonds for means.

    The p-value is the Mann-Whitney test's, as the paper prints it. Violins end at the lowest and highest trial; under
    six values, of which no spread can be drawn, there are dots alone.
    """
    n = len(analysis.objects)
    figure = new_figure(2.6 * n + 0.6, 5.2)
    axes = figure.subplots(2, n, squeeze=False)
    metrics = (("duration_s", "completion time, s"), ("slips", "slips per trial"))
    for row, (metric, label) in enumerate(metrics):
        for column, name in enumerate(analysis.objects):
            mine = [
                (t.condition, getattr(t, metric)) for t in analysis.trials if t.counts and t.object == name
            ]
            values = [
                [float(value) for condition, value in mine if condition == one and value is not None]
                for one in analysis.conditions
            ]
            ax = axes[row, column]
            _violins(ax, values, analysis.conditions)
            key = metric, name, "as printed"
            p = next((t.p for t in analysis.tests if (t.metric, t.object, t.level) == key), None)
            _bracket(ax, values[:2], p_text(p))
            if metric == "slips":
                ax.yaxis.get_major_locator().set_params(integer=True)
            if row == 0:
                ax.set_title(name, fontsize=10)
            if column == 0:
                ax.set_ylabel(label, fontsize=9)
    return figure


def _violins(ax: Axes, values: Sequence[Sequence[float]], names: Sequence[str]) -> None:
    for place, some in enumerate(values, start=1):
        if not some:
            continue
        many = len(some) >= VIOLIN_FROM
        if many:
            drawn = ax.violinplot([some], positions=[place], widths=0.75, showextrema=False)
            for body in drawn["bodies"]:  # type: ignore[attr-defined]  # matplotlib's type is too wide
                body.set(facecolor=ARMS[(place - 1) % len(ARMS)], edgecolor="black", linewidth=0.6, alpha=0.6)
        ax.plot(_spread(some, place), some, "o", color="black", markersize=2.6 if many else 4.5, zorder=3)
        mean = float(np.mean(some))
        ax.plot([place], [mean], "D", color=MEAN_RED, mec="black", mew=0.5, markersize=6, zorder=4)
    ax.set_xticks(range(1, len(names) + 1), names, fontsize=8)
    ax.set_xlim(0.4, len(names) + 0.6)
    ax.tick_params(axis="y", labelsize=8)
    ax.spines[["top", "right"]].set_visible(False)


def _spread(values: Sequence[float], place: float) -> list[float]:
    """Set equal values side by side, so that every trial is seen; no chance in it."""
    total = {value: list(values).count(value) for value in values}
    seen: dict[float, int] = {}
    at = []
    for value in values:
        k = seen[value] = seen.get(value, -1) + 1
        width = min(0.3, 0.035 * (total[value] - 1))
        at.append(place + (0 if total[value] == 1 else width * (2 * k / (total[value] - 1) - 1)))
    return at


def _bracket(ax: Axes, values: Sequence[Sequence[float]], text: str) -> None:
    top = max((max(some) for some in values if some), default=1.0) or 1.0
    reach = max(ax.get_ylim()[1], top)
    y, tick = reach + 0.02 * reach, 0.02 * reach
    ax.plot([1, 1, 2, 2], [y, y + tick, y + tick, y], color="black", linewidth=0.8)
    ax.text(1.5, y + 1.3 * tick, text, ha="center", va="bottom", fontsize=8)
    ax.set_ylim(0, y + 7 * tick)


def figure_8_trials(analysis: Analysis, courses: Mapping[str, TouchCourse]) -> dict[str, list[str]]:
    """Choose Fig 8's trials: the first person with courses of all objects, the first three haptic ones each.

    Trial IDs by object; empty if there are none.
    """
    condition = analysis.conditions[0]
    able = [t for t in analysis.trials if t.counts and t.condition == condition and t.id in courses]
    for person in dict.fromkeys(t.participant for t in able):
        mine = [t for t in able if t.participant == person]
        chosen = {name: [t.id for t in mine if t.object == name][:FIG_8_ROWS] for name in analysis.objects}
        if all(chosen.values()):
            return chosen
    return {}


def figure_8(analysis: Analysis, courses: Mapping[str, TouchCourse]) -> Figure | None:
    """Draw Fig 8: columns objects, rows trials; CCI, EDA on the left axis, the pose dashed on the right, 0 to 4."""
    chosen = figure_8_trials(analysis, courses)
    if not chosen:
        return None
    rows = max(len(ids) for ids in chosen.values())
    figure = new_figure(3.2 * len(chosen) + 0.4, 1.7 * rows + 0.6)
    axes = figure.subplots(rows, len(chosen), squeeze=False)
    lines = []
    for column, (name, ids) in enumerate(chosen.items()):
        for row in range(rows):
            ax = axes[row, column]
            if row >= len(ids):
                ax.set_visible(False)
                continue
            course = on_grid(courses[ids[row]])
            (cci,) = ax.plot(course.t_s, course.cci, color=CCI_BLUE, linewidth=1.3, label="CCI")
            (eda,) = ax.plot(course.t_s, course.eda, color=EDA_GREEN, linewidth=1.9, label="EDA")
            right = ax.twinx()
            style: dict[str, Any] = {"color": POSE_RED, "linewidth": 1.3, "linestyle": "--"}
            (pose,) = right.step(course.t_s, course.pose, where="post", label="pose", **style)
            lines = [cci, eda, pose]
            ax.set_ylim(0, 1.02)
            right.set_ylim(0, 4.08)
            right.set_yticks(range(5))
            ax.tick_params(labelsize=7)
            right.tick_params(labelsize=7)
            ax.set_title(f"{name}, {ids[row]}" if row == 0 else ids[row], fontsize=8)
            if column == 0:
                ax.set_ylabel("CCI, EDA", fontsize=8)
            if column == len(chosen) - 1:
                right.set_ylabel("pose", fontsize=8)
            if row == rows - 1:
                ax.set_xlabel("time, s", fontsize=8)
    figure.legend(handles=lines, loc="outside upper center", ncols=3, fontsize=8, frameon=False)
    return figure


def lag_figure(analysis: Analysis) -> Figure | None:
    """Draw the correlation over the lag, an arm a line, with what other trials' touch gives."""
    signals = list(dict.fromkeys(arm.signal for arm in analysis.arms))
    if not signals:
        return None
    figure = new_figure(3.6 * len(signals) + 0.4, 3.0)
    axes = figure.subplots(1, len(signals), squeeze=False, sharey=True)[0]
    for ax, signal in zip(axes, signals, strict=True):
        arms = [arm for arm in analysis.arms if arm.signal == signal]
        for arm, color, style in zip(
            arms, (CCI_BLUE, POSE_RED, "#555555", EDA_GREEN) * 2, ["-", "--", "-.", ":"] * 2, strict=False
        ):
            r = [np.nan if value is None else value for value in arm.lag_r]
            ax.plot(arm.lags_s, r, color=color, linestyle=style, label=arm.condition)
            if arm.r_others is not None:
                ax.plot([0], [arm.r_others], marker="x", color=color, markersize=7, linestyle="none")
        ax.axvline(0, color="0.7", linewidth=0.8)
        ax.set_xlabel("lag, s: pose follows touch  <  0  <  touch follows pose", fontsize=8)
        ax.set_title(f"pose and {signal.upper()}; ×: touch of other trials", fontsize=9)
        ax.tick_params(labelsize=8)
        ax.spines[["top", "right"]].set_visible(False)
    axes[0].set_ylabel("Pearson r", fontsize=9)
    axes[0].legend(fontsize=8, frameon=False)
    return figure


def pose_figure(analysis: Analysis) -> Figure | None:
    """Draw the share of time at each pose, a bar an object and condition."""
    uses = analysis.pose_use
    if not uses:
        return None
    figure = new_figure(6.4, 0.32 * len(uses) + 1.1)
    ax = figure.subplots()
    left = np.zeros(len(uses))
    places = np.arange(len(uses))[::-1]
    style: dict[str, Any] = {"edgecolor": "black", "linewidth": 0.4}
    for pose, shade in enumerate(("#f0f0f0", "#c6dbef", "#6baed6", "#2171b5", "#08306b")):
        share = np.array([use.dwell[pose] for use in uses])
        ax.barh(places, share, left=left, color=shade, label=str(pose), **style)
        left += share
    ax.set_yticks(places, [f"{use.object}, {use.condition}" for use in uses], fontsize=8)
    ax.set_xlim(0, 1)
    ax.set_xlabel("share of time at each pose", fontsize=8)
    ax.tick_params(labelsize=8)
    figure.legend(
        loc="outside upper center", ncols=5, fontsize=8, frameon=False, title="pose", title_fontsize=8
    )
    return figure
