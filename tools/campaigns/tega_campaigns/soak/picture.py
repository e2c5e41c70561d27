"""A soak as a picture: its faults and its memory over time."""

from __future__ import annotations

from pathlib import Path

from tega.runtime.lifecycle import require
from tega_campaigns.soak.report import SoakReport

__all__ = ["draw"]

_ROW_IN = 0.14
_GOOD, _BAD, _TOLD, _MEMORY = "#8fb8de", "#d1495b", "#20639b", "#3b3b3b"


def draw(report: SoakReport, path: Path) -> None:
    """Draw every fault as a bar from its beginning until all was well again, above each process's memory.

    The ending of ``path`` is the kind of picture.
    """
    figures = require("matplotlib.figure", driver="the picture of a soak", extra="pictures")
    rows = sorted({(f.device, f.kind) for f in report.faults}, reverse=True)
    above, below = 0.5 + _ROW_IN * len(rows), 1.4
    figure = figures.Figure(figsize=(10, above + below), layout="constrained")
    faults, memory = figure.subplots(2, 1, sharex=True, height_ratios=(above, below))
    faults.set_ylim(-0.8, len(rows) - 0.2)
    for f in report.faults:
        row = rows.index((f.device, f.kind))
        end_s = f.recovered_s or f.ended_s or f.injected_s
        faults.barh(
            row,
            max(end_s - f.injected_s, 0.3),
            left=f.injected_s,
            color=_GOOD if f.good else _BAD,
            height=0.7,
        )
        if f.detected_s is not None:
            faults.plot([f.detected_s] * 2, [row - 0.35, row + 0.35], color=_TOLD, linewidth=1.5)
    faults.set_yticks(range(len(rows)), [f"{device}: {kind}" for device, kind in rows], fontsize=7)
    faults.set_title(
        "Bars: from the fault until all is well again; dark line: told. All devices emulated.", fontsize=9
    )
    faults.grid(axis="x", alpha=0.3)
    for process in report.memory:
        memory.plot(*zip(*process, strict=True), color=_MEMORY, linewidth=1)
    memory.set_ylim(bottom=0)
    memory.set_ylabel("memory, MiB", fontsize=8)
    memory.set_xlabel("seconds", fontsize=8)
    memory.grid(alpha=0.3)
    figure.savefig(path, dpi=110)
