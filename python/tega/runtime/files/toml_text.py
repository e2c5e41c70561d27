"""Write TOML with tomlkit: values, nested tables, a run's settings; name the next step for a file that is no TOML.

Equal values give equal bytes. A file with comments is made as a tomlkit document by its writer; this module holds the
parts that every writer needs: ``None`` left out, paths as text, times in UTC.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from typing import Any, Final

import tomlkit
from tomlkit.items import Item, Table

_PLACE: Final = re.compile(r"at line (\d+)")
ESCAPES: Final = "a backslash in double quotes is an escape: write a path in single quotes, or with /"
"""Next step for a value that a backslash has changed."""

# What may stand wrong in a line, and what to do, the surest first.
_RULES: Final = (
    (re.compile("[\u201c\u201d\u201e\u2018\u2019\u00ab\u00bb]"), 'use straight quotes: "…"'),
    (re.compile(r'"[^"]*\\'), ESCAPES),
    (re.compile(r"=\s*[+-]?\d+,\d+\s*([,}#]|$)"), "write a decimal point, such as 250.5"),
    (
        re.compile(r"\{[^}]*$"),
        "an inline table { … } stands on one line; or write a [table] with a line for each key",
    ),
    (re.compile(r"=\s*[A-Za-z_~/][^\"']*$"), 'put text into quotes, such as driver = "allegro"'),
)


def toml_item(value: Any) -> Item:
    """Return a value as a tomlkit item that stands on one line, to be put into a document.

    ``value`` is text, a bool, a number, a time with its zone (written in UTC, whole seconds), or lists and
    mappings of those; a key with the value ``None`` is left out.
    """
    if isinstance(value, Mapping):
        table = tomlkit.inline_table()
        table.update({key: toml_item(one) for key, one in value.items() if one is not None})
        return table
    if isinstance(value, list | tuple):
        array = tomlkit.array()
        array.extend(map(toml_item, value))
        return array
    if isinstance(value, datetime):
        value = value.astimezone(UTC).replace(microsecond=0)
    item: Item = tomlkit.item(value)
    return item


def toml_value(value: Any) -> str:
    """Return a value as TOML has it, on one line; see :func:`toml_item`.

    Example:
        >>> toml_value({"port": "/dev/ttyUSB0", "gains": [1.0, 24], "raw": True})
        '{port = "/dev/ttyUSB0", gains = [1.0, 24], raw = true}'
    """
    return toml_item(value).as_string()


def tree_text(tree: Mapping[str, Any]) -> str:
    """Write nested tables as TOML; ``None`` is left out."""
    return tomlkit.dumps(tree_item(tree))


def tree_item(tree: Mapping[str, Any]) -> Table:
    """Return nested tables as a tomlkit table, to which comments can be added; ``None`` is left out."""
    table = tomlkit.table()
    kept = {key: value for key, value in tree.items() if value is not None}
    for key, value in sorted(kept.items(), key=lambda pair: isinstance(pair[1], Mapping)):
        table.add(key, tree_item(value) if isinstance(value, Mapping) else toml_item(value))
    return table


def toml_hint(text: str, error: ValueError) -> str:
    """Return the next step for a text that is no TOML."""
    message = str(error)
    if "twice" in message or "overwrite" in message:
        return "a table or a key stands in the file twice: join them"
    place = _PLACE.search(message)
    lines = text.splitlines()
    line = lines[int(place[1]) - 1] if place and 0 < int(place[1]) <= len(lines) else ""
    return next((hint for rule, hint in _RULES if rule.search(line)), "see https://toml.io")


def swallowed_escape(tree: object) -> tuple[str, str] | None:
    r"""Return key and text of a value that a backslash has changed, such as ``"C:\temp"`` with a tab in it."""
    for key, value in tree_values(tree):
        if isinstance(value, str) and (
            re.search("[\b\t\f\r]", value) or (re.match("[A-Za-z]:", value) and "\n" in value)
        ):
            return key, value
    return None


def tree_values(tree: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Yield every value in nested tables and lists with its key, such as ``emg.options.channels[1]``."""
    if isinstance(tree, Mapping):
        for name, value in tree.items():
            yield from tree_values(value, f"{key}.{name}" if key else str(name))
    elif isinstance(tree, list | tuple):
        for k, value in enumerate(tree):
            yield from tree_values(value, f"{key}[{k}]")
    else:
        yield key, tree
