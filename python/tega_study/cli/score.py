"""Compare raters of the same trials: ``tega-teleop study score``."""

from __future__ import annotations

from pathlib import Path

import click

from tega.ui.cli.options import echo_json, json_option
from tega_study.cli.options import folder_argument, shown_option

_COLUMNS = {
    "event": "kind",
    "first": "a",
    "second": "b",
    "trials": "trials",
    "n first": "n_a",
    "n second": "n_b",
    "F1": "f1",
    "chance": "chance_f1",
    "delay s": "delay_s",
    "kappa 1 s": "kappa",
    "ICC": "icc",
    "": "note",
}
"""Attributes of an agreement in the printed table, by heading."""


@click.command(epilog="Example: tega-teleop study score my-study --boris my-study.boris")
@folder_argument
@shown_option(
    "--tolerance-s", type=click.FloatRange(0.01, 10), default=1.0,
    help="How far apart two events may be and still be one; 0.5 suits video, 1 suits live.",
)  # fmt: skip
@click.option("--boris", type=click.Path(path_type=Path), metavar="OUT.boris", help="Write a BORIS project.")
@click.option(
    "--elan",
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    help="Write an ELAN file for each trial into a new folder.",
)
@click.option(
    "--import", "taken", type=click.Path(path_type=Path), metavar="FILE",
    help="Events to import: a BORIS project (.boris, .boris.gz), its tabular or aggregated events as TSV or CSV, or an "
    "ELAN file or a folder of them.",
)  # fmt: skip
@click.option(
    "--rater", metavar="ID", help="With --import: code of the rater whose events they are; it must be new."
)
@json_option
def score(
    *,
    folder: Path,
    tolerance_s: float,
    boris: Path | None,
    elan: Path | None,
    taken: Path | None,
    rater: str | None,
    as_json: bool,
) -> None:
    """Compare raters, experimenter and, in simulation, the truth on the same trials.

    F1 of matched events with its chance level, delay, Cohen's kappa in bins of a second, ICC of the counts. With
    --json: {"agreements": [...], "imported": {person: trials}, "boris": file, "elan": folder}.
    """
    import msgspec

    from tega_study.plan import read_plan
    from tega_study.score import agreements, export_boris, export_elan, import_boris

    if (taken is None) != (rater is None):
        raise click.UsageError("--import FILE and --rater ID belong together")
    read_plan(folder)
    imported = {} if taken is None or rater is None else import_boris(folder, taken, rater)
    written = 0 if boris is None else export_boris(folder, boris)
    n_elan = 0 if elan is None else export_elan(folder, elan)
    found = agreements(folder, tolerance_s=tolerance_s)
    if as_json:
        files = {"boris": None if boris is None else str(boris), "elan": None if elan is None else str(elan)}
        echo_json({"agreements": msgspec.to_builtins(found), "imported": imported, **files})
        return
    for person, n in imported.items():
        click.echo(f"{person}: {n} trials of rater {rater} taken in")
    if boris is not None:
        click.echo(f"{boris}: {written} observations")
    if elan is not None:
        click.echo(f"{elan}: {n_elan} ELAN files")
    if not found:
        click.echo("nothing to compare: two accounts of the same trials are needed, such as two raters")
        return
    click.echo(f"events within {tolerance_s:g} s are one; delay: second less first")
    rows = [
        tuple(_COLUMNS),
        *(tuple(_cell(getattr(one, name)) for name in _COLUMNS.values()) for one in found),
    ]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        click.echo("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())


def _cell(value: str | float | None) -> str:
    if value is None:
        return "–"
    return f"{value:.2f}" if isinstance(value, float) else str(value)
