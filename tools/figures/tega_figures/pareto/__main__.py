"""Measure the codecs of recorded pictures; print the table of docs/evidence/pareto.md and draw its picture.

::

    TEGA_DATA=/path/to/recordings python -m tega_figures.pareto docs/images/pareto-jpeg-quality.svg
"""

from __future__ import annotations

from pathlib import Path

import click

from tega_figures.bench.timing import single_threaded
from tega_figures.pareto.drawing import drawn, table
from tega_figures.pareto.jpeg import jpeg_quality


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("picture", type=click.Path(dir_okay=False, path_type=Path))
@click.option("--budget", default=3.0, show_default=True, help="Seconds that timing may take.")
def main(picture: Path, *, budget: float) -> None:
    """Measure, draw, and print."""
    with single_threaded():
        choice = jpeg_quality(budget_s=budget)
    drawn(choice).savefig(picture, metadata={"Date": None})
    click.echo(table(choice))


if __name__ == "__main__":
    main()
