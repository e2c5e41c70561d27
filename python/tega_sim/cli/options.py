"""Options that verbs of the simulated bench share."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tega.config import file_sets
from tega.errors import InvalidValueError
from tega.runtime.words import nearest_hint
from tega.ui.cli.options import NAMES, NUMBERS, all_options, preset_option

if TYPE_CHECKING:
    from rich.console import Console

    from tega_sim.world.objects import ObjectSpec

objects_option = click.option(
    "--objects",
    type=NAMES,
    default="bottle,container,bag",
    show_default=True,
    help="Objects that are lifted.",
)


object_options = all_options(
    click.option(
        "--view",
        type=click.Choice(["direct", "aside", "hidden"]),
        default="direct",
        show_default=True,
        help="How well people see the hand while it holds.",
    ),
    click.option(
        "--objects-file",
        type=click.Path(path_type=Path, dir_okay=False, exists=True),
        metavar="FILE.toml",
        help="File that describes the --objects, as tega_sim/world/objects.toml does.",
    ),
    click.option(
        "--mass-kg",
        type=NUMBERS,
        help="Mass instead of each object's own. Every combination with the next two options is run.",
    ),
    click.option("--stiffness-n-m", type=NUMBERS, help="Stiffness of the object's wall, instead of its own."),
    click.option(
        "--friction", type=NUMBERS, help="Friction between object and gel, instead of the object's own."
    ),
)
"""Lifted objects of simulated trials: an object file, and factors to cross its objects with."""


def chosen_objects(names: list[str], file: Path | None) -> dict[str, ObjectSpec]:
    """Return the objects of these names in a file; ``None`` means the package's own."""
    from tega_sim.world.objects import read_objects

    known = read_objects(file)
    for name in names:
        if name not in known:
            raise InvalidValueError(f"object {name!r} is not known", nearest_hint(name, known))
    return {name: known[name].spec for name in names}


loop_options = all_options(
    preset_option,
    click.option(
        "--config",
        type=click.Path(path_type=Path, dir_okay=False),
        metavar="LAB.toml",
        help="Take the stages, session.pose_base and the vest's layout, mirror, threshold and step from here.",
    ),
    click.option(
        "--set",
        "sets",
        multiple=True,
        metavar="KEY=VALUE",
        help="A setting of the loop: stages.*, session.pose_base, vest.layout, vest.mirror, vest.threshold, "
        "vest.step; repeatable.",
    ),
)
"""The loop of a simulated trial: preset, settings file, single settings."""


def loop_sets(config: Path | None, sets: tuple[str, ...]) -> tuple[str, ...]:
    """Return the settings of a simulated trial's loop as ``key=value``: a file's, then the single ones."""
    if config is None:
        return sets
    return (*file_sets(config), *sets)


def print_rows(title: str, rows: Iterable[Any], columns: Mapping[str, Callable[[Any], str]]) -> Console:
    """Print a table of rows by the text of each column, words to the left, numbers to the right; return the console."""
    from tega.ui.cli.report import figures_table, wide_console

    out, words = wide_console(), ("object", "condition")
    table = figures_table(words, [name for name in columns if name not in words], title)
    for row in rows:
        table.add_row(*(text(row) for text in columns.values()))
    out.print(table)
    return out
