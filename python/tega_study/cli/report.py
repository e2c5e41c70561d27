"""Analyse studies and plan their size: ``tega-teleop study report`` and ``power``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from tega.ui.cli.options import PATH, answer, echo_json, json_option
from tega_study.cli.options import FOLDER, shown_option


@click.command(epilog="Example: tega-teleop study report my-study")
@click.argument("source", type=PATH)
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

    from tega.ui.cli.report import figures_table, wide_console
    from tega_study.report import table_1, write_report

    done = write_report(source, out, unblind=unblind)
    if as_json:
        tests = [
            test for test in done.analysis.tests if f"{test.metric}:{test.object}" in done.analysis.family
        ]
        first = [] if done.analysis.blind else table_1(done.analysis)
        where = {"page": str(done.page), "tables": str(done.tables), "blind": done.analysis.blind}
        echo_json({**where, "table1": first, "tests": msgspec.to_builtins(tests)})
        return
    console, analysis = wide_console(), done.analysis
    if analysis.interim:
        results = "results are withheld (--unblind shows them)" if analysis.blind else "results shown early"
        console.print(f"interim: {analysis.flow.complete} people complete; {results}")
    if not analysis.blind:
        head, *rows = table_1(analysis)
        title = "Table I, simulated" if analysis.simulated else "Table I"
        displayed = figures_table(head[:2], head[2:], f"{title}: means, time in seconds")
        for row in rows:
            displayed.add_row(*row)
        console.print(displayed)
    click.echo(f"{done.page}")


_SIZES = (6, 9, 12, 18, 24)
_ALPHA = 0.05
"""Two-sided level of the report's tests."""


@click.command(epilog="Example: tega-teleop study power --slips 5.9,2.8 --trials 10")
@shown_option("--slips", default="5.9,2.8", help="Mean per trial without and with touch.")
@shown_option("--trials", type=click.IntRange(1, 1000), default=10, help="Trials of each condition.")
@shown_option(
    "--tests",
    type=click.IntRange(1, 100),
    default=7,
    help="Number of tests in the plan's family, for Holm's correction. The others find nothing.",
)
@json_option
def power(*, slips: str, trials: int, tests: int, as_json: bool) -> None:
    """Compute how many people a study needs to find a difference in counts.

    Draws studies with people who hardly differ, who differ, and who differ a lot, and analyses each as the report does:
    sign-flips of people's means, corrected by Holm's method.
    """
    from tega_study.power import MOST_PEOPLE, SPREADS, PlannedTest, least_people, people_for, power_of

    try:
        reference, mean = (float(part) for part in slips.split(","))
    except ValueError as error:
        raise click.BadParameter("give two numbers, such as 5.9,2.8", param_hint="--slips") from error
    family = [
        PlannedTest("slips", mean, reference),
        *[PlannedTest("slips", reference, reference)] * (tests - 1),
    ]
    least, over = least_people("slips", tests=tests), f"over {MOST_PEOPLE}"
    rows: list[dict[str, Any]] = []
    lines = [
        f"{reference:g} against {mean:g} per trial, {trials} trials per condition; sign-flips over people, "
        f"Holm over {tests} tests, p < {_ALPHA:g}",
        f"least number of people: {least or over}; with fewer no result can be significant",
        f"people differ   for 80 %   power with {', '.join(map(str, _SIZES))} people",
    ]
    for name, spread in SPREADS.items():
        needed = people_for(family, trials=trials, spread=spread)
        some = [power_of(family, people=n, trials=trials, spread=spread) for n in _SIZES]
        people = needed and needed.people
        found = {one.people: one.found for one in some}
        rows.append({"people_differ": name, "people_for_80": people, "power": found})
        powers = "  ".join(f"{one:.2f}" for one in found.values())
        lines.append(f"{name:<14}  {people or over:>8}   {powers}")
    lines.append("effects seen in a small pilot are too large on average: plan for less")
    given = {"reference": reference, "mean": mean, "trials": trials, "alpha": _ALPHA, "tests": tests}
    answer({**given, "least_people": least, "rows": rows}, lines, as_json=as_json)
