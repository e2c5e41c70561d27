"""Draw how late ticks came: ``python -m tega_figures.late_ticks docs/images/late-ticks.png idle.json busy.json``.

Each file holds what ``tega-teleop bench loop --json`` printed, and becomes a panel.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any, Final

import numpy as np

from tega.ui.view.figures import new_figure

_SHOWN: Final = {
    "hand_ticks": ("answers to the hand, its own process", "#c8202f"),
    "witness_ticks": ("a bare clock beside it", "#1f5fbf"),
    "late_ticks": ("ticks of the run's own loop", "#9aa0a6"),
}


def draw(path: Path, files: list[Path]) -> None:
    """Write the picture.

    Args:
        path: The PNG.
        files: The runs.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    figure = new_figure(figsize=(5.5 * len(files), 4))
    panels = np.atleast_1d(figure.subplots(1, len(files), sharey=True))
    for ax, file in zip(panels, files, strict=True):
        report = json.loads(file.read_text(encoding="utf-8"))
        edges_ms = report["late_edges_ms"]
        names = [f"≤ {edges_ms[0]:g}", *(f"{edge:g}" for edge in edges_ms)]
        for k, (which, (said, colour)) in enumerate(_SHOWN.items()):
            late = report[which]
            label = f"{said}: worst {late['worst_ms']:.1f} ms"
            x = np.arange(len(names)) + 0.27 * (k - 1)
            ax.bar(x, np.array(late["late"]) / late["ticks"], 0.27, color=colour, label=label)
        ax.set_xticks(range(len(names)), names)
        ax.set_yscale("log")
        ax.set_ylim(5e-5, 3)
        ax.set_xlabel("later than, ms")
        ax.set_title(_title(report))
        ax.legend(fontsize="small", frameon=False)
    panels[0].set_ylabel("share of ticks")
    figure.savefig(path, dpi=110)


def _title(report: dict[str, Any]) -> str:
    busy = (
        f"{report['busy']} busy program{'' if report['busy'] == 1 else 's'}"
        if report["busy"]
        else "nothing else"
    )
    return f"beside it {busy}{', page open' if report['page'] else ''}"


if __name__ == "__main__":
    draw(Path(sys.argv[1]), [Path(name) for name in sys.argv[2:]])
