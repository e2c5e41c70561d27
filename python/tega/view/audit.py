"""The picture of an audit: what each reading takes for the contact, and how its area goes over the frames."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tega.audit import READINGS, Mark, ReadingScore, mean_difference
from tega.view.figures import CCI_BLUE, EDA_GREEN, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_audit", "draw_curves"]

MARK_YELLOW, AREA_BLUE = "#ffd23f", "#3b8cff"


def draw_audit(
    path: Path,
    frames: Sequence[NDArray[np.uint8]],
    baseline: NDArray[np.uint8],
    scores: Sequence[ReadingScore],
    *,
    marks: Sequence[Mark] = (),
) -> None:
    """Write the picture of an audit.

    Args:
        path: The PNG to write.
        frames: The frames of the audit, uint8 (H, W, 3), BGR.
        baseline: The untouched gel.
        scores: One a reading.
        marks: The frames' marked circles, where there are any.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    figure = new_figure(figsize=(1.5 * len(scores) + 1, 7.5))
    upper, lower = figure.subfigures(2, 1, height_ratios=[1.2, 1], squeeze=False)[:, 0]
    shown = int(np.argmax(scores[-1].eda))
    for ax, score in zip(upper.subplots(1, len(scores), squeeze=False)[0], scores, strict=True):
        _draw_mask(ax, frames[shown], READINGS[score.reading](frames[shown], baseline).mask, score)
        if marks:
            _draw_mark(ax, marks[shown])
    ax = lower.subplots()
    n_pixels = baseline.shape[0] * baseline.shape[1]
    for score in scores:
        ax.plot(np.array(score.eda) / n_pixels, marker=".", lw=1, label=score.reading)
    if marks:
        discs = [np.pi * mark.radius_px**2 / n_pixels for mark in marks]
        ax.plot(discs, color=MARK_YELLOW, lw=3, zorder=0, label="marked circle")
    ax.set_xlabel("frame")
    ax.set_ylabel("EDA, share of the picture")
    ax.set_ylim(-0.02, 1.05)
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8, frameon=False)
    figure.savefig(path, metadata={"Software": None})


def draw_curves(
    path: Path,
    frames: Sequence[NDArray[np.uint8]],
    baseline: NDArray[np.uint8],
    scores: Sequence[ReadingScore],
    *,
    title: str,
) -> None:
    """Draw EDA and CCI of the presets over the frames, each as a share of its largest value.

    Args:
        path: The PNG to write.
        frames: The frames of the audit, uint8 (H, W, 3), BGR.
        baseline: The untouched gel.
        scores: One a reading; those that are no preset are left out.
        title: Over the picture.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    presets = [score for score in scores if score.reading.split(" ")[0] in ("paper", "live")]
    figure = new_figure(figsize=(8, 2.2 * len(presets) + 0.6))
    figure.suptitle(title, fontsize=9)
    press = mean_difference(frames, baseline)
    for ax, score in zip(
        figure.subplots(len(presets), 1, sharex=True, squeeze=False)[:, 0], presets, strict=True
    ):
        ax.fill_between(
            range(len(press)), press / max(press.max(), 1e-9), color="0.88", label="mean difference"
        )
        for values, name, form, colour in (
            (score.eda, "EDA", "d", EDA_GREEN),
            (score.cci, "CCI", ".3f", CCI_BLUE),
        ):
            ax.plot(
                np.array(values) / max(*values, 1e-9),
                color=colour,
                lw=1.3,
                label=f"{name}, most {max(values):{form}}",
            )
        ax.set_ylabel(f"{score.reading}\nshare of the most", fontsize=8)
        ax.set_ylim(-0.02, 1.05)
        ax.legend(loc="upper right", fontsize=7, frameon=False)
    ax.set_xlabel("frame")
    figure.savefig(path, metadata={"Software": None})


def _draw_mask(ax: Axes, frame: NDArray[np.uint8], mask: NDArray[np.bool_], score: ReadingScore) -> None:
    ax.imshow(frame[..., ::-1])
    tint = np.zeros((*mask.shape, 4))
    tint[mask] = (1.0, 1.0, 1.0, 0.35)
    ax.imshow(tint)
    if mask.any() and not mask.all():
        ax.contour(mask, levels=[0.5], colors=[AREA_BLUE], linewidths=1.2)
    ax.set_xticks([])
    ax.set_yticks([])
    ax.set_title(score.reading.replace(", ", ",\n").replace(" (", "\n("), fontsize=8)


def _draw_mark(ax: Axes, mark: Mark) -> None:
    angle = np.linspace(0, 2 * np.pi, 200)
    x, y = mark.centre_xy
    ax.plot(x + mark.radius_px * np.cos(angle), y + mark.radius_px * np.sin(angle), color=MARK_YELLOW, lw=1.2)
    ax.set_xlim(-0.5, ax.get_images()[0].get_array().shape[1] - 0.5)  # type: ignore[union-attr]
    ax.set_ylim(ax.get_images()[0].get_array().shape[0] - 0.5, -0.5)  # type: ignore[union-attr]
