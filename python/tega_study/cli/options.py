"""Arguments and options that verbs of a study share."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final, TypeVar

import click

from tega.ui.cli.options import NAMES, all_options
from tega_sim.cli.options import objects_option

_Function = TypeVar("_Function", bound=Callable[..., Any])

FOLDER: Final = click.Path(path_type=Path, file_okay=False)

folder_argument = click.argument("folder", type=FOLDER)
participant_argument = click.argument("participant")
shown_option = partial(click.option, show_default=True)


def _shard(_ctx: click.Context, _option: click.Parameter, text: str) -> tuple[int, int]:
    """Read the part of a simulation that is shared between machines, or fail with a usage error."""
    part, _, parts = text.partition("/")
    if not (part.isdecimal() and parts.isdecimal() and 1 <= int(part) <= int(parts)):
        raise click.BadParameter(f"{text!r} is not i/n with i from 1 to n, such as 2/4")
    return int(part), int(parts)


def trials_option(default: int) -> Callable[[_Function], _Function]:
    """Return the option of the trials of each object and condition."""
    text = "Trials of each object under each condition."
    return shown_option("--trials", type=click.IntRange(1, 1000), default=default, help=text)


def design_options(*, seed: str, conditions: str = "") -> Callable[[_Function], _Function]:
    """Return the options of a study's design: seed, objects, conditions, trials.

    ``seed`` is what the seed is for, ``conditions`` further help for the conditions.
    """
    what = f"Conditions: the first is compared with the second{conditions}."
    return all_options(
        shown_option("--seed", type=click.IntRange(0, 2**63 - 1), default=1, help=seed),
        objects_option,
        shown_option("--conditions", type=NAMES, default="haptic,non-haptic", help=what),
        trials_option(10),
    )


workers_options = all_options(
    click.option(
        "--jobs", type=click.IntRange(0, 1024), default=0, help="Worker processes; 0 for all cores."
    ),
    click.option(
        "--shard",
        metavar="I/N",
        callback=_shard,
        default="1/1",
        help="Only the i-th of n parts, for many machines.",
    ),
)
"""Where sessions run: cores, a part for this machine."""
