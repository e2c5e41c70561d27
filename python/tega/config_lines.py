"""On which line of a TOML file each value stands."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from typing import Any

__all__ = ["leaves", "value_lines"]


def value_lines(text: str) -> dict[str, int]:
    r"""Return the line, from 1, on which the statement of each value begins.

    The text is cut into its statements by the parser itself: lines are added until they parse, which a value over
    several lines does only at its end.

    Args:
        text: Valid TOML.

    Returns:
        By dotted key. A value that shares its line with others, as in an inline table, has that line.

    Example:
        >>> value_lines("[emg]\nkind = 'raw'\noptions = { port = 'COM3' }")
        {'emg.kind': 2, 'emg.options.port': 3}
    """
    lines: dict[str, int] = {}
    table, waiting, first = "", "", 0
    for number, line in enumerate(text.split("\n"), start=1):
        if not waiting:
            if line.lstrip().startswith("["):
                table = line
                continue
            first = number
        waiting += f"{line}\n"
        try:
            statement = tomllib.loads(f"{table}\n{waiting}")
        except tomllib.TOMLDecodeError:
            continue
        lines.update(dict.fromkeys((key for key, _ in leaves(statement)), first))
        waiting = ""
    return lines


def leaves(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield every value that is no table, by its dotted key."""
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value
