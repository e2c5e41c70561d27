"""Test every kernel at its extremes against exact arithmetic: ``tega-teleop stress``."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING

import click

from tega.cli.options import json_option

if TYPE_CHECKING:
    from tega_campaigns.stress import StressCase

__all__ = ["stress"]


@click.command(epilog="Example: tega-teleop stress --quick")
@click.option("--quick", is_flag=True, help="A million samples instead of a hundred million.")
@click.option("--markdown", is_flag=True, help="Print the page of the documentation.")
@json_option
@click.pass_context
def stress(ctx: click.Context, *, quick: bool, markdown: bool, as_json: bool) -> None:
    """Try every kernel at its extremes and compare with exact arithmetic.

    Exits with 1 if a case misses its bound. With --json a list of objects is printed, one a case, with the fields of
    tega_campaigns.stress.StressCase and `passed`; an error that is not a number (something exact was wrong) is null.
    """
    import msgspec

    from tega.cli.options import echo_json, progress_bar
    from tega_campaigns.stress import render_page, run_stress

    if markdown and as_json:
        raise click.UsageError("--markdown and --json exclude each other")
    with progress_bar() as tell:
        cases = run_stress(quick=quick, tell=tell)
    if as_json:
        echo_json(
            [
                {
                    **msgspec.to_builtins(c),
                    "error": c.error if isfinite(c.error) else None,
                    "passed": c.passed,
                }
                for c in cases
            ]
        )
    elif markdown:
        click.echo(render_page(cases), nl=False)
    else:
        _print(cases)
    if not all(c.passed for c in cases):
        ctx.exit(1)


def _print(cases: list[StressCase]) -> None:
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    from tega_campaigns.stress import GROUPS
    from tega_campaigns.stress.case import short

    console = Console(highlight=False)
    for group, title in GROUPS.items():
        table = Table(title=title, title_justify="left", box=SIMPLE)
        table.add_column("case", ratio=2)
        table.add_column("done", ratio=4)
        table.add_column("happened", ratio=5)
        for name in ("error", "bound"):
            table.add_column(name, justify="right", no_wrap=True)
        for c in cases:
            if c.group == group:
                told = f"{c.happened}; {c.timing}" if c.timing else c.happened
                verdict = short(c.error) if c.passed else f"{short(c.error)} MISSED"
                table.add_row(*(escape(cell) for cell in (c.name, c.done, told, verdict, f"{c.bound:.2g}")))
        console.print(table)
    missed = sum(not c.passed for c in cases)
    console.print(f"{len(cases)} cases, {missed or 'none'} beyond its bound")
