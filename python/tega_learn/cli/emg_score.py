"""Score closure levels by a measured force: ``tega-teleop emg score``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tega.ui.cli.emg_logs import kind_option, reading_options
from tega.ui.cli.options import PATH, echo_json, json_option
from tega_learn.logs import emg_beside

if TYPE_CHECKING:
    from tega.runtime.files.tables.table import Reading
    from tega_learn.score import RecordingScore

BLOCK_S = 0.1


@click.command(
    epilog="Example: tega-teleop emg score squeeze.mat --force Force --rate-hz 200 --kind raw --channels 3,6,8",
)
@click.argument("files", nargs=-1, required=True, type=PATH, metavar="FILE [FILE ...]")
@click.option(
    "--force",
    required=True,
    help="The measured force: a variable's name in a file of arrays, else a column from 1.",
)
@kind_option("--kind", "raw")
@reading_options
@json_option
def score(*, files: tuple[Path, ...], force: str, kind: Any, reading: Reading, as_json: bool) -> None:
    """Score both presets on recordings of EMG and force.

    The first half of each FILE gives the maxima, the second half is judged: rank correlation of the fused level with
    the force, changes of level per second, and the delay of `live` behind `paper`. With --json: a list of
    objects, one per file: file, duration_s, paper and live with rank_correlation, changes_per_s, delay_s.
    """
    from dataclasses import asdict

    from tega_learn.score import score_recording

    scores: dict[str, RecordingScore] = {}
    for file in files:
        samples, measured, rate_hz = emg_beside(file, force, "--force", reading)
        tau = max(1, round(BLOCK_S * rate_hz))
        scores[file.name] = score_recording(samples, measured, rate_hz, tau=tau, kind=kind)
    if as_json:
        echo_json([{"file": name, **asdict(score)} for name, score in scores.items()])
    else:
        _print_scores(scores)


def _print_scores(scores: dict[str, RecordingScore]) -> None:
    import numpy as np
    from rich.console import Console

    from tega.ui.cli.report import figures_table

    table = figures_table(["recording"], ["paper ρ", "changes/s", "live ρ", "changes/s", "live later by"])
    rows: list[tuple[float, ...]] = []
    for score in scores.values():
        paper, live = score.paper, score.live
        figures = (paper.rank_correlation, paper.changes_per_s, live.rank_correlation, live.changes_per_s)
        rows.append((*figures, live.delay_s))
    named = list(zip(scores, rows, strict=True))
    if len(rows) > 1:
        named.append(("mean", tuple(float(v) for v in np.mean(rows, axis=0))))
    for name, (*shown, delay_s) in named:
        table.add_row(name, *map(format, shown, (".3f", ".2f", ".3f", ".2f")), f"{1000 * delay_s:.0f} ms")
    Console(highlight=False).print(table)
