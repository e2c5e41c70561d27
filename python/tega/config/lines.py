"""Find the line of a TOML file on which each value stands."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from typing import Any


def value_lines(text: str) -> dict[str, int]:
    r"""Return the line, from 1, on which the statement of each value begins.

    The text is cut into its statements by the parser itself: lines are added until they parse, which a value over
    several lines does only at its end.

    Returns:
        By dotted key; a table of an array has its number, as in ``stages.beside[0].name``. A value that shares its line
        with others, as in an inline table, has that line.

    Example:
        >>> value_lines("[emg]\nkind = 'raw'\noptions = { port = 'COM3' }")
        {'emg.kind': 2, 'emg.options.port': 3}
    """
    lines: dict[str, int] = {}
    table, waiting, first = "", "", 0
    seen: dict[str, int] = {}
    for number, line in enumerate(text.split("\n"), start=1):
        if not waiting:
            if line.lstrip().startswith("["):
                table = line
                if line.lstrip().startswith("[["):
                    # A table of its own, even where nothing follows.
                    ((name, _),) = leaves(tomllib.loads(line), numbered=False)
                    seen[name] = seen.get(name, -1) + 1
                continue
            first = number
        waiting += f"{line}\n"
        try:
            statement = tomllib.loads(f"{table}\n{waiting}")
        except tomllib.TOMLDecodeError:
            continue
        for key, _ in leaves(statement):
            lines[_counted(key, seen) if table.lstrip().startswith("[") else key] = first
        waiting = ""
    return lines


def _counted(key: str, seen: Mapping[str, int]) -> str:
    """Return a key within the newest table of an array: alone, each of them is parsed as number 0."""
    for name, number in seen.items():
        for begin in (f"{name}[0].", f"{name}."):
            if key.startswith(begin):
                return f"{name}[{number}].{key.removeprefix(begin)}"
    return key


def leaves(tree: Mapping[str, Any], prefix: str = "", *, numbered: bool = True) -> Iterator[tuple[str, Any]]:
    """Yield every value that is no table, by its dotted key; tables of an array are numbered, or stay whole."""
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from leaves(value, f"{prefix}{key}.", numbered=numbered)
        elif numbered and isinstance(value, list) and value and all(isinstance(one, dict) for one in value):
            for number, one in enumerate(value):
                yield from leaves(one, f"{prefix}{key}[{number}].")
        else:
            yield f"{prefix}{key}", value
