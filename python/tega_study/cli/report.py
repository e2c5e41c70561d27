"""Analyse a study and write its report: ``tega-teleop study report``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from tega.ui.cli.options import echo_json, json_option
from tega_study.cli.options import FOLDER

if TYPE_CHECKING:
    from tega_study.analyse import Analysis


@click.command(epilog="Example: tega-teleop study report my-study")
@click.argument("source", type=click.Path(path_type=Path))
@click.option("--out", type=FOLDER, help="Folder for report.html and report/; the study's own unless given.")
@click.option(
    "--unblind",
    is_flag=True,
    help="Compare conditions before the plan is complete; the study's journal and report keep that.",
)
@json_option
def report(*, source: Path, out: Path | None, unblind: bool, as_json: bool) -> None:
    """Analyse a study's folder, or a file of sim trials, and write one HTML page with tables and figures.

    Everything comes from the folder; the same folder gives the same bytes. Until the plan is complete the report says
    who took part and no result. --json prints {page, tables, blind, table1, tests}, tests as in report/tests.csv.
    """
    import msgspec

    from tega_study.report import write_report
    from tega_study.tables import table_1

    done = write_report(source, out, unblind=unblind)
    if as_json:
        tests = [
            test for test in done.analysis.tests if f"{test.metric}:{test.object}" in done.analysis.family
        ]
        echo_json(
            {
                "page": str(done.page),
                "tables": str(done.tables),
                "blind": done.analysis.blind,
                "table1": [] if done.analysis.blind else table_1(done.analysis),
                "tests": msgspec.to_builtins(tests),
            }
        )
        return
    _print(done.analysis)
    click.echo(f"{done.page}")


def _print(analysis: Analysis) -> None:
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table

    from tega_study.tables import table_1

    out = Console(highlight=False, width=110)
    if analysis.interim:
        results = "results are withheld (--unblind shows them)" if analysis.blind else "results shown early"
        out.print(f"interim: {analysis.flow.complete} people complete; {results}")
    if analysis.blind:
        return
    head, *rows = table_1(analysis)
    title = "Table I, simulated" if analysis.simulated else "Table I"
    displayed = Table(title=f"{title}: means, time in seconds", title_justify="left", box=SIMPLE)
    for place, name in enumerate(head):
        displayed.add_column(name, justify="left" if place < 2 else "right")
    for row in rows:
        displayed.add_row(*row)
    out.print(displayed)
