"""Make one Table I of the bundles of several sites: ``tega-teleop study sites``."""

from __future__ import annotations

from pathlib import Path

import click

from tega.errors import InvalidValueError
from tega.ui.cli.options import echo_json, json_option
from tega_study.cli.options import FILE


@click.command(epilog="Example: tega-teleop study sites here/*.zip there/*.zip --out table1.csv")
@click.argument("bundles", type=FILE, nargs=-1, required=True)
@click.option("--out", type=FILE, help="CSV file for the table; new.")
@click.option("--unblind", is_flag=True, help="Compare conditions before the plan of every site is complete.")
@json_option
def sites(*, bundles: tuple[Path, ...], out: Path | None, unblind: bool, as_json: bool) -> None:
    """Average the sessions of several sites as Table I: each site, and all together.

    BUNDLES are files of study bundle; those of one plan are one site. Every hash is checked and every trial is worked
    out again. --json prints {sites, interim, rehearsed, table1}.
    """
    from tega_study.sites import sites_table
    from tega_study.tables import csv_text

    if out is not None and out.exists():
        raise InvalidValueError(f"{out}: is there already", "name a new file")
    found = sites_table(bundles, unblind=unblind)
    text = csv_text(found.rows)
    if out is not None:
        out.write_text(text, encoding="utf-8", newline="\n")
    rehearsed = found.sites[0].rehearsed
    if as_json:
        of = [{"site": s.name, "plan_sha256": s.plan_sha256, "complete": s.complete} for s in found.sites]
        echo_json({"sites": of, "interim": found.interim, "rehearsed": rehearsed, "table1": found.rows})
        return
    for site in found.sites:
        click.echo(
            f"{site.name}: {site.complete} of {site.planned} people complete, plan {site.plan_sha256[:12]}"
        )
    if rehearsed:
        click.echo("not data of persons: the sessions ran on simulated or emulated devices")
    if found.interim:
        click.echo("interim: conditions are compared before every plan is complete")
    click.echo(text if out is None else f"{out}", nl=out is not None)
