"""Draw Fig 3: from a fingertip's picture to CCI and EDA, a row an object."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from tega.ui.view.figures import draw_map
from tega_study.figures import new_figure
from tega_study.finger_rows import FingerRow
from tega_study.touch_picture import FingerPicture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def figure_3(rows: Sequence[FingerRow], pictures: Mapping[str, FingerPicture]) -> Figure | None:
    """Draw Fig 3: untouched gel, frame, difference, the metric's map with the marks of CCI and EDA."""
    if not rows:
        return None
    figure = new_figure(7.0, 2.05 * len(rows) + 0.3)
    axes = figure.subplots(len(rows), 4, squeeze=False)
    for number, row in enumerate(rows):
        _row(axes[number], row, pictures[row.trial], titled=number == 0)
    return figure


def _row(axes: Sequence[Axes], row: FingerRow, picture: FingerPicture, *, titled: bool) -> None:
    frame, metrics, touch_map = picture.touch
    off = np.abs(frame.astype(np.int16) - picture.baseline).mean(axis=2)
    axes[0].imshow(picture.baseline[..., ::-1])
    axes[1].imshow(frame[..., ::-1])
    axes[2].imshow(off, cmap="gray", vmin=0, vmax=max(float(off.max()), 1.0))
    draw_map(axes[3], frame.shape, metrics, touch_map)
    for ax, title in zip(axes, ("untouched", "touched", "difference", "touch map"), strict=True):
        ax.set_xticks([])
        ax.set_yticks([])
        if titled:
            ax.set_title(title, fontsize=9)
    axes[0].set_ylabel(f"{row.object}, {row.finger}", fontsize=9)
    axes[2].set_xlabel(f"up to {off.max():.0f} of 255", fontsize=9)
    cci, eda = ("–" if one is None else f"{one:.2f}" for one in (row.cci_norm, row.eda_norm))
    axes[3].set_xlabel(f"CCI {cci}   EDA {eda}", fontsize=9)
