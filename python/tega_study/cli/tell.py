"""Lead a running session from another program: ``tega-teleop study tell``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from tega.ui.cli.options import echo_json, json_option
from tega_study.cli.options import folder_argument, participant_argument

if TYPE_CHECKING:
    from tega_study.lead.tell import Command

# As in tega_study.lead.tell, which takes long to import.
COMMANDS: Final = ("start", "mark", "slip", "deformation", "drop", "undo", "end", "break", "safety", "quit")


@click.command(epilog="Example: tega-teleop study tell my-study p01 start")
@folder_argument
@participant_argument
@click.argument("command", type=click.Choice(COMMANDS))
@json_option
def tell(*, folder: Path, participant: str, command: Command, as_json: bool) -> None:
    """Give the session that study run leads on this machine a command, as if its key had been pressed.

    A command has the effect of the key at that moment: start does not begin a trial during a rest. The answer
    contains the session's state. A program that does not want to start a process appends a line such as {"do":
    "start"} to FOLDER/sessions/ID/told.jsonl.
    """
    from tega.runtime.clock import SystemClock
    from tega_study.lead.tell import notify as give
    from tega_study.plan import read_plan

    read_plan(folder).of(participant)
    board = give(folder, participant, command, clock=SystemClock())
    if as_json:
        echo_json({"participant": participant, "phase": board.phase, "trial": board.trial})
    else:
        click.echo(f"{participant}: {board.phase}, trial {board.trial} of {board.n_trials}")
