"""Show how a file of EMG is read, and score closure levels by a force: ``tega-teleop emg``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tega.ui.cli.calibrate import emg_recalibrate
from tega.ui.cli.emg_logs import emg_beside, kind_option, reading_options
from tega.ui.cli.guest_group import GuestGroup
from tega.ui.cli.options import PATH, echo_json, json_option

if TYPE_CHECKING:
    from tega.emg.score import RecordingScore
    from tega.runtime.files.tables.decide import Decision
    from tega.runtime.files.tables.table import Reading


@click.group(cls=GuestGroup, epilog="Example: tega-teleop emg compare --help")
def emg() -> None:
    """Fit a decoder to a person's muscles, refit it to a day, and compare decoders on one log."""


emg.add_command(emg_recalibrate, "recalibrate")


@emg.command("inspect", epilog="Example: tega-teleop emg inspect squeeze.csv")
@click.argument("file", type=PATH, required=False)
@reading_options
@json_option
def emg_inspect(*, file: Path | None, reading: Reading, as_json: bool) -> None:
    """Show how FILE is read: format, channels, time, rate, losses, events. Without FILE, list the formats.

    \b
    --json prints an object: file, format, channels, names, unit, time and counter (columns from 1, 0 for none),
      columns (number, name, unit, holds, why, constant, unix), facts (encoding, delimiter, decimal, first_line, names),
      sideways, rate_hz, rate_from, n_samples, events (t_s, text), faults, notes, words
    Without FILE a list: name, suffixes, library, origin.
    """  # noqa: D301  # click keeps the lines after \b as they are
    import msgspec

    from tega.runtime.files.formats import FORMATS
    from tega.runtime.files.signals import read_signals

    if file is None:
        formats = [
            {"name": f.name, "suffixes": f.suffixes, "library": f.library, "origin": f.origin}
            for f in FORMATS
        ]
        if as_json:
            echo_json(formats)
            return
        for one in FORMATS:
            endings = " ".join(one.suffixes) or "any other"
            click.echo(
                f"{one.name:14} {endings:20} {one.origin}" + (f"  ({one.library})" if one.library else "")
            )
        return
    decision = read_signals(file, reading).decision
    if as_json:
        echo_json(msgspec.to_builtins(decision))
    else:
        _print_decision(decision)


def _print_decision(decision: Decision) -> None:
    rate = (
        f"{decision.rate_hz:g} samples/s (by {decision.rate_from})" if decision.rate_hz else "no rate stated"
    )
    named = [name or f"column {c}" for c, name in zip(decision.channels, decision.names, strict=True)]
    unit = f", in {decision.unit}" if decision.unit else ""
    click.echo(f"{decision.file}: {decision.format}, {decision.n_samples} samples, {rate}")
    click.echo(f"channels: {', '.join(named)}{unit}")
    for line in (decision.words, *decision.faults, *decision.notes):
        if line:
            click.echo(line)
    for event in decision.events[:20]:
        click.echo(f"event at {event.t_s:.3f} s: {event.text}")
    if len(decision.events) > 20:
        click.echo(f"{len(decision.events) - 20} more events")


BLOCK_S = 0.1


@emg.command(
    "score",
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
def emg_score(*, files: tuple[Path, ...], force: str, kind: Any, reading: Reading, as_json: bool) -> None:
    """Score both presets on recordings of EMG and force.

    The first half of each FILE gives the maxima, the second half is judged: rank correlation of the fused level with
    the force, changes of level per second, and the delay of `live` behind `paper`. With --json: a list of
    objects, one per file: file, duration_s, paper and live with rank_correlation, changes_per_s, delay_s.
    """
    from dataclasses import asdict

    from tega.emg.score import score_recording

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
