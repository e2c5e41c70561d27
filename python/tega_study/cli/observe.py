"""Score trials as they are run: ``tega-teleop study observe``."""

from __future__ import annotations

from pathlib import Path

import click

from tega.errors import InvalidValueError, MissingExtraError
from tega_study.cli.options import folder_argument, participant_argument, shown_option


@click.command(epilog="Example: tega-teleop study observe my-study p01 --rater r1")
@folder_argument
@participant_argument
@shown_option("--rater", default="r1", metavar="ID", help="Who observes: a code, no name.")
@click.option("--recorded", "--no-view", is_flag=True, hidden=True)
def observe(*, folder: Path, participant: str, rater: str, recorded: bool) -> None:
    """Score a session as it goes on: one key an event, in a terminal of its own.

    Start it before or after study run, on the same machine, also over SSH. The same command goes on after a stop.
    Recordings are coded in BORIS: see study clips.

    Each rater has a file of their own. Neither the condition nor another rater is shown. Needs the extra observe.
    """
    from importlib.util import find_spec

    if recorded:
        raise InvalidValueError(
            "--recorded: recordings are coded in BORIS, no more in this console",
            f"tega-teleop study clips {folder} OUT --rater {rater}",
        )
    if find_spec("textual") is None:
        raise MissingExtraError("textual is not installed", "pip install 'tega[observe]'")
    from tega_study.observe.console import Console

    Console(folder, participant, rater).run()
