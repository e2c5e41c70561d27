"""``tega-teleop study observe``."""

from __future__ import annotations

from pathlib import Path

import click

from tega.cli.options import debug_option

__all__ = ["observe"]


@click.command(epilog="Example: tega-teleop study observe my-study p01 --rater r1")
@click.argument("folder", type=click.Path(path_type=Path, file_okay=False))
@click.argument("participant")
@click.option("--rater", default="r1", show_default=True, metavar="ID", help="Who observes: a code, no name.")
@debug_option
def observe(*, folder: Path, participant: str, rater: str) -> None:
    """Score a session as it goes on: one key an event, in a terminal of its own.

    Start it before or after study run, on the same machine, also over SSH. Each rater has a file of their own. Neither
    the condition nor another rater is shown. Needs the extra observe.
    """
    from importlib.util import find_spec

    from tega.errors import MissingExtraError

    if find_spec("textual") is None:
        raise MissingExtraError("textual is not installed", "pip install 'tega[observe]'")
    from tega.study.observe.console import Console

    Console(folder, participant, rater).run()
