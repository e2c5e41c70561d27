"""Draw simulated trials: a row each, fingertips at their firmest beside the course of touch and pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from tega.ui.view.figures import SessionCourse, TouchPicture, draw_course, draw_touch, new_figure

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.figure import SubFigure
    from numpy.typing import NDArray

__all__ = ["TrialPicture", "trials_figure"]

_EVENT_COLOURS = {"slip": "#c8202f", "deformation": "#8a4fbf", "drop": "#000000"}


class TrialPicture(NamedTuple):
    """Contacts and course of one trial, to be drawn.

    Attributes:
        title: Heading of its row.
        touch: Firmest contact by finger; a finger that touched nothing has an untouched picture.
        course: Touch and level over time.
        height_t_s: Times of the heights, seconds, float64 (n,).
        height_m: Height of the object, metres, float64 (n,).
        events: Kind and time of each event.
    """

    title: str
    touch: Mapping[str, TouchPicture]
    course: SessionCourse
    height_t_s: NDArray[np.float64]
    height_m: NDArray[np.float64]
    events: Sequence[tuple[str, float]]


def trials_figure(path: Path, trials: Sequence[TrialPicture], title: str) -> None:
    """Write the picture of simulated trials.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    figure = new_figure(figsize=(16, 0.5 + 2.4 * len(trials)))
    figure.suptitle(title, fontsize=12)
    rows: list[SubFigure] = list(figure.subfigures(len(trials), 1, squeeze=False)[:, 0])
    for row, trial in zip(rows, trials, strict=True):
        row.suptitle(trial.title, fontsize=10, x=0.01, ha="left")
        left, right = row.subfigures(1, 2, width_ratios=[1.6, 1], squeeze=False)[0]
        axes = left.subplots(1, 2 * len(trial.touch), squeeze=False)[0]
        for index, (finger, picture) in enumerate(trial.touch.items()):
            draw_touch(axes[2 * index : 2 * index + 2], finger, picture)
            marked = axes[2 * index + 1]
            marked.set_title(marked.get_title(), fontsize=7.5)
        ax = right.subplots()
        ax.fill_between(
            trial.height_t_s, trial.height_m / 0.25, color="0.88", zorder=0, label="height / 0.25 m"
        )
        draw_course(ax, trial.course)
        for kind, t_s in trial.events:
            if kind in _EVENT_COLOURS:
                ax.axvline(t_s, color=_EVENT_COLOURS[kind], lw=0.9, ls=":")
                ax.text(t_s, 1.0, f" {kind}", color=_EVENT_COLOURS[kind], fontsize=8, va="top")
    figure.savefig(path, dpi=85, metadata={"Software": None})
