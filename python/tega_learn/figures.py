"""Draw how decoders follow a target."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tega.ui.view.figures import new_figure
from tega_learn.compare import DecoderReport


def draw_decoders(parts: list[tuple[str, float, list[DecoderReport]]], file: Path) -> None:
    """Draw a picture, a row a decoder and a column a part.

    A part is its title, the length of a block in s, and the decoders' results.
    """
    rows = max(len(reported) for _, _, reported in parts)
    figure = new_figure(figsize=(5.5 * len(parts), 1.5 * rows + 0.6))
    panels = figure.subplots(rows, len(parts), sharex="col", sharey=True, squeeze=False)
    for column, (title, block_s, reported) in enumerate(parts):
        for row, one in enumerate(reported):
            panel = panels[row, column]
            t_s = np.arange(1, len(one.closure) + 1) * block_s
            panel.fill_between(t_s, one.target, color="0.85", linewidth=0)
            panel.plot(t_s, one.closure, linewidth=1.0)
            panel.set_title(f"{one.decoder}: rank {one.figures.rank_correlation:.2f}", fontsize=8, loc="left")
            panel.tick_params(labelsize=7)
        panels[0, column].set_title(
            f"{title}\n{panels[0, column].get_title(loc='left')}", fontsize=8, loc="left"
        )
        panels[-1, column].set_xlabel("time (s)", fontsize=8)
    figure.supylabel("closure 0 to 1; grey: target", fontsize=8)
    figure.savefig(file)
