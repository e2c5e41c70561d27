"""Analyse a study and write its report: ``tega-teleop study report``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from tega.ui.cli.options import echo_json, json_option

if TYPE_CHECKING:
    from tega_study.analyse import Analysis


_FOLDER = click.Path(path_type=Path, file_okay=False)


@click.command(epilog="Example: tega-teleop study report my-study")
@click.argument("source", type=click.Path(path_type=Path))
@click.option("--out", type=_FOLDER, help="Folder for report.html and report/; the study's own unless given.")
@click.option("--interim", is_flag=True, help="Show p-values although the plan is not done yet.")
@json_option
def report(*, source: Path, out: Path | None, interim: bool, as_json: bool) -> None:
    """Analyse a study's folder, or a file of sim trials, and write one HTML page with tables and figures.

    Everything comes from the folder; the same folder gives the same bytes. --json prints {page, tables, table1,
    tests}, tests as in report/tests.csv.
    """
    import msgspec

    from tega_study.report import write_report
    from tega_study.tables import table_1

    done = write_report(source, out, interim=interim)
    if as_json:
        tests = [
            test for test in done.analysis.tests if f"{test.metric}:{test.object}" in done.analysis.family
        ]
        echo_json(
            {
                "page": str(done.page),
                "tables": str(done.tables),
                "table1": table_1(done.analysis),
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
    head, *rows = table_1(analysis)
    title = "Table I, simulated" if analysis.simulated else "Table I"
    shown = Table(title=f"{title}: means, time in seconds", title_justify="left", box=SIMPLE)
    for place, name in enumerate(head):
        shown.add_column(name, justify="left" if place < 2 else "right")
    for row in rows:
        shown.add_row(*row)
    out.print(shown)
    if analysis.interim:
        text = "p-values are withheld" if not analysis.p_shown else "p-values shown early"
        out.print(f"interim: {analysis.flow.complete} people complete; {text}")
