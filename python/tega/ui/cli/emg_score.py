"""Score how well the closure levels follow a measured force: ``tega-teleop emg score``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tega.ui.cli.emg_logs import READ_OPTION, emg_beside
from tega.ui.cli.options import ChannelList, json_option

if TYPE_CHECKING:
    from tega.emg.score import RecordingScore


BLOCK_S = 0.1


@click.command(
    epilog="Example: tega-teleop emg score squeeze.mat --force Force --rate-hz 200 --kind raw --channels 3,6,8"
)
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="FILE [FILE ...]")
@click.option(
    "--force",
    required=True,
    help="The measured force: a variable's name in a file of arrays, else a column from 1.",
)
@click.option(
    "--rate-hz",
    type=click.FloatRange(0, 10_000_000, min_open=True),
    help="Samples per second; else as the file states them.",
)
@click.option(
    "--kind",
    type=click.Choice(["raw", "rectified", "envelope"]),
    default="raw",
    show_default=True,
    help="Whether the samples are raw, rectified or an envelope.",
)
@click.option(
    "--channels",
    type=ChannelList(),
    help="EMG columns, counted from 1; else all of the array in a file of arrays.",
)
@click.option(
    "--variable", default="emg", show_default=True, help="Name of the EMG array in a file of several."
)
@READ_OPTION
@json_option
def emg_score(*, files: tuple[Path, ...], as_json: bool, **flags: Any) -> None:
    """Score both presets on recordings of EMG and force.

    The first half of each FILE gives the maxima, the second half is judged: rank correlation of the fused level with
    the force, changes of level per second, and the delay of `live` behind `paper`. With --json: a list of
    objects, one per file: file, duration_s, paper and live with rank_correlation, changes_per_s, delay_s.
    """
    from dataclasses import asdict

    from tega.ui.cli.options import echo_json

    scores = {file.name: _score(file, **flags) for file in files}
    if as_json:
        echo_json([{"file": name, **asdict(score)} for name, score in scores.items()])
    else:
        _print(scores)


def _score(
    file: Path,
    *,
    force: str,
    rate_hz: float | None,
    kind: Any,
    channels: list[int] | None,
    variable: str,
    read: dict[str, Any],
) -> RecordingScore:
    from tega.emg.score import score_recording

    samples, measured, rate_hz = emg_beside(
        file, force, option="--force", rate_hz=rate_hz, channels=channels, variable=variable, read=read
    )
    return score_recording(samples, measured, rate_hz, tau=max(1, round(BLOCK_S * rate_hz)), kind=kind)


def _print(scores: dict[str, RecordingScore]) -> None:
    import numpy as np
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table

    table = Table(box=SIMPLE)
    table.add_column("recording", no_wrap=True)
    for name in ("paper ρ", "changes/s", "live ρ", "changes/s", "live later by"):
        table.add_column(name, justify="right")
    rows: list[tuple[float, ...]] = [
        (
            s.paper.rank_correlation,
            s.paper.changes_per_s,
            s.live.rank_correlation,
            s.live.changes_per_s,
            s.live.delay_s,
        )
        for s in scores.values()
    ]
    named = list(zip(scores, rows, strict=True))
    if len(rows) > 1:
        named.append(("mean", tuple(float(v) for v in np.mean(rows, axis=0))))
    for name, (paper, paper_changes, live, live_changes, delay) in named:
        table.add_row(
            name,
            f"{paper:.3f}",
            f"{paper_changes:.2f}",
            f"{live:.3f}",
            f"{live_changes:.2f}",
            f"{1000 * delay:.0f} ms",
        )
    Console(highlight=False).print(table)
