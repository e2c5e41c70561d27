"""Fit a decoder, compare decoders on logs: ``emg fit``, ``emg compare``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tega.ui.cli.emg import kind_option, reading_options
from tega.ui.cli.options import FILE, NAMES, PATH, FiniteRange, PngPath, echo_json, json_option
from tega_learn.logs import force_log, read_log, read_tracked, target_option

if TYPE_CHECKING:
    from tega.runtime.files.tables.table import Reading
    from tega_learn.compare import DecoderReport


@click.command(
    epilog="Example: tega-teleop emg fit calibrations/people/p01/practice/20261122-150405.toml --out p01.json"
)
@click.argument("log", type=PATH, metavar="LOG")
@click.option("--out", required=True, type=FILE, help="The model's file.")
@target_option
@kind_option("--kind", "raw")
@reading_options
@click.option(
    "--model",
    type=click.Choice(["ridge", "huber", "kernel"]),
    default="ridge",
    show_default=True,
    help="Regression that is fitted.",
)
@click.option(
    "--features",
    type=NAMES,
    default="MAV,LOGVAR",
    show_default=True,
    help="Features of each block and channel.",
)
@click.option(
    "--tau-ms", type=FiniteRange(10, 1000), default=100.0, show_default=True, help="Length of a block."
)
@click.option(
    "--person", default="", help="Code of the person whose muscles they are; a practice record knows it."
)
@json_option
def fit(
    *,
    log: Path,
    out: Path,
    target: str | None,
    kind: Any,
    reading: Reading,
    model: Any,
    features: list[str],
    tau_ms: float,
    person: str,
    as_json: bool,
) -> None:
    """Fit a decoder to LOG and write it to a file, for `stages.decoder.options.model`.

    LOG is a record of `tega-teleop practice`, which contains rate, kind, channels and person; or a file of EMG with a
    force or a closure, with --target and --rate-hz. With --json: {"file", "lag_s", "duration_s", "data_sha256",
    "person", "channels", "rate_hz", "in_sample": {...figures of emg compare, on the training data itself...}}.
    """
    from tega_learn.decoders import fit as fit_decoder
    from tega_learn.score import judge

    full, names = None, tuple[str, ...]()
    if log.suffix == ".toml":
        given, record = read_tracked(log)
        full, names, person = 1.0, record.channels, person or record.person
    else:
        if target is None:
            raise click.UsageError(f"{log.name} is no practice record: name --target")
        given = force_log(log, target, kind, reading)
        names = tuple(f"ch{c}" for c in reading.channels)
    tau = max(4, round(tau_ms / 1000 * given.rate_hz))
    decoder = fit_decoder(
        given.samples,
        given.target,
        rate_hz=given.rate_hz,
        tau=tau,
        kind=given.kind,
        features=features,
        model=model,
        full=full,
        channels=names,
        person=person,
    )
    decoder.save(out)
    made = decoder.model
    closure = decoder.process(given.samples)
    wanted = (given.target[: len(closure) * tau].reshape(-1, tau).mean(axis=1) / made.full).clip(0, 1)
    figures = judge(closure, decoder.levels, wanted, tau / given.rate_hz, confidence=decoder.confidence)
    if as_json:
        reported = {
            f: getattr(made, f)
            for f in ("lag_s", "duration_s", "data_sha256", "person", "channels", "rate_hz")
        }
        echo_json({"file": str(out), **reported, "in_sample": figures.as_json()})
        return
    click.echo(
        f"{out.name}: {made.model} on {', '.join(made.features)} of {len(made.channels)} channels, "
        f"{made.duration_s:.0f} s; target {1000 * made.lag_s:+.0f} ms after the muscles"
    )
    click.echo(
        f"rank correlation with the target {figures.rank_correlation:.2f}, on the training data itself: "
        "tega-teleop emg compare judges on data kept back"
    )
    click.echo(f'use it: [stages.decoder] name = "learned", options = {{ model = "{out}" }}')


@click.command(
    epilog="Example: tega-teleop emg compare v1.mat v2.mat --target Force --rate-hz 200 --channels 3,6,8 "
    "--picture compare.png"
)
@click.argument("logs", nargs=-1, required=True, metavar="LOG [LOG ...]")
@target_option
@kind_option("--kind", "raw")
@reading_options
@click.option(
    "--decoders",
    type=NAMES,
    default="rules-paper,rules,proportional,learned",
    show_default=True,
    help="Decoders to compare; learned-huber, learned-kernel and any installed one are possible, too.",
)
@click.option("--train", help="Train on this log instead, and judge each LOG whole: across days.")
@click.option(
    "--recalibrate",
    "recalibrate_s",
    type=FiniteRange(0, 3600),
    default=0.0,
    metavar="SECONDS",
    help="Recalibrate maxima and models with the first seconds of the judged part, and judge the rest.",
)
@click.option("--picture", type=PngPath(), help="Draw target and closures into this PNG.")
@json_option
def compare(
    *,
    logs: tuple[str, ...],
    target: str | None,
    kind: Any,
    reading: Reading,
    decoders: list[str],
    train: str | None,
    recalibrate_s: float,
    picture: Path | None,
    as_json: bool,
) -> None:
    """Compare decoders on logs of EMG with a force or a closure.

    Each LOG is cut in time: decoders are calibrated on its first half and judged on its second, and vice versa
    (swapped). A record of `tega-teleop practice` contains its rate and target. To join files of one class each into a
    log: rest.csv=0,close.csv=1,rest2.csv=0.

    \b
    --json prints a list, with an object per log, part and decoder:
      log, trained_on, judged_on, decoder, rank_correlation, level_rank_correlation, correlation, rmse,
      changes_per_s, delay_s and level_delay_s (behind rules-paper), target_delay_s, at_level, balanced_accuracy,
      false_closings_per_min, calibration_error, held, duration_s
    """  # noqa: D301  # click keeps the lines after \b as they are
    from tega_learn.compare import compare as compared
    from tega_learn.compare import two_halves

    rows: list[dict[str, Any]] = []
    drawn: list[tuple[str, float, list[DecoderReport]]] = []
    for name in logs:
        log = read_log(name, target, kind, reading)
        pairs = [("first half", "second half", *two_halves(log))]
        if train is not None:
            learnt = read_log(train, target, kind, reading)
            pairs = [(learnt.name, "whole", learnt, log)]
        else:
            pairs.append(("second half", "first half (swapped)", *two_halves(log, swapped=True)))
        for trained_on, judged_on, learn, judged in pairs:
            if recalibrate_s:
                judged_on += f", recalibrated by its first {recalibrate_s:g} s"  # noqa: PLW2901
            reported = compared(learn, judged, decoders, recalibrate_s=recalibrate_s)
            where = {"log": log.name, "trained_on": trained_on, "judged_on": judged_on}
            rows += [where | {"decoder": one.decoder} | one.figures.as_json() for one in reported]
            drawn.append((f"{log.name}, {judged_on}", log.tau / log.rate_hz, reported))
    if picture is not None:
        from tega_learn.compare import draw_decoders

        draw_decoders(drawn, picture)
    if as_json:
        echo_json(rows)
    else:
        _print(rows)


_COLUMNS = (
    ("rank", "rank_correlation", 1, ".2f"),
    ("r", "correlation", 1, ".2f"),
    ("RMSE", "rmse", 1, ".2f"),
    ("chg/s", "changes_per_s", 1, ".2f"),
    ("later", "delay_s", 1000, ".0f"),
    ("level", "at_level", 100, ".0f"),
    ("b-acc", "balanced_accuracy", 100, ".0f"),
    ("false", "false_closings_per_min", 1, ".1f"),
    ("conf", "calibration_error", 1, ".2f"),
    ("held", "held", 100, ".0f"),
)
_MEANT = (
    "rank, r: correlations with the target; chg/s: changes of level; later: than rules-paper, ms; level: % of time at "
    "the target's level; b-acc: balanced accuracy of rest against effort, %; false: closings at rest per minute; conf: "
    "error of confidence; held: % of blocks. Details: docs/evidence/emg-decoders.md"
)


def _print(rows: list[dict[str, Any]]) -> None:
    from itertools import groupby

    from tega.ui.cli.report import figures_table, wide_console

    console = wide_console()
    for (log, trained_on, judged_on), some in groupby(
        rows, key=lambda row: (row["log"], row["trained_on"], row["judged_on"])
    ):
        title = f"{log}: trained on {trained_on}, judged on {judged_on}"
        layout: dict[str, Any] = {"padding": (0, 1, 0, 0), "pad_edge": False, "show_edge": False}
        table = figures_table(["decoder"], [name for name, *_ in _COLUMNS], title, **layout)
        for row in some:
            cells = [
                "–" if row[key] is None else format(row[key] * times, form)
                for _, key, times, form in _COLUMNS
            ]
            table.add_row(row["decoder"], *cells)
        console.print(table)
    console.print(_MEANT)
