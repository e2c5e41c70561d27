"""Make tables of figures for a terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table


def figures_table(left: Sequence[str], right: Sequence[str], title: str = "", **layout: Any) -> Table:
    """Return an empty table: columns of words, then columns of figures."""
    table = Table(title=title or None, title_justify="left", **({"box": SIMPLE} | layout))
    for place, name in enumerate(left):
        table.add_column(name, no_wrap=place == 0)
    for name in right:
        table.add_column(name, justify="right")
    return table


def wide_console() -> Console:
    """Return a console that breaks no line of a table where the output is no terminal."""
    return Console(highlight=False, width=None if Console().is_terminal else 160)
