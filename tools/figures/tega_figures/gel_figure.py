"""The pictures of the page on simulated touch; generated, no recording in them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tega.tactile import contact_mask
from tega.ui.view.figures import new_figure
from tega_figures.check_touch import SHAPES, readings, shape
from tega_sim.gel import Gel

__all__ = ["draw_presses", "draw_readings"]

TRUE_WHITE, AREA_YELLOW = "#ffffff", "#ffd23f"
# Shape and force of each column; one unit a column.
_DISPLAYED = (
    ("ball 4.4 mm", 0.5),
    ("ball 4.4 mm", 4.0),
    ("cylinder 3 mm", 3.0),
    ("edge", 2.0),
    ("flat 5 x 5 mm", 3.0),
    ("bottle wall 33 mm", 5.0),
)


def draw_presses(path: Path) -> None:
    """Write simulated pictures of six units, their differences, what touches (white) and what live outlines (yellow).

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    figure = new_figure(figsize=(9, 4.1))
    axes = figure.subplots(2, len(_DISPLAYED))
    for seed, (name, force_n) in enumerate(_DISPLAYED, start=1):
        gel = Gel(seed)
        image, still = gel.frame([shape(name, force_n)], 0), gel.still()
        upper, lower = axes[:, seed - 1]
        upper.imshow(image[..., ::-1])
        upper.set_title(f"{name}, {force_n} N", fontsize=8)
        lower.imshow(np.clip(128 + 1.5 * (image.astype(int) - still), 0, 255).astype(np.uint8)[..., ::-1])
        lower.contour(gel.contact_mask(), [0.5], colors=TRUE_WHITE, linewidths=0.8)
        lower.contour(contact_mask(image, still), [0.5], colors=AREA_YELLOW, linewidths=0.8)
        for ax in (upper, lower):
            ax.set_axis_off()
    figure.savefig(path, dpi=110)


def draw_readings(path: Path) -> None:
    """Write what live reads over what is true, for rising forces.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    figure = new_figure(figsize=(9, 3.4))
    areas, heights = figure.subplots(1, 2)
    for name in SHAPES:
        found = readings(name, Gel(3))
        seen = [r for r in found if r.eda]
        areas.plot([r.area_px for r in found], [r.eda for r in found], marker=".", lw=1, label=name)
        heights.plot([r.depth_mm for r in seen], [r.cci for r in seen], marker=".", lw=1, label=name)
    areas.plot([0, 30_000], [0, 30_000], color="0.6", lw=1, ls=":")
    areas.set(xlabel="touching area, pixels", ylabel="EDA, pixels", xlim=(0, 30_000), ylim=(0, 40_000))
    heights.set(xlabel="depth, mm", ylabel="CCI", xlim=(0, 2))
    heights.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7, frameon=False)
    figure.savefig(path, dpi=90)
