"""Write TOML with tomlkit: single values, nested tables, and the settings of a run.

Equal values give equal bytes. A file with comments is made as a tomlkit document by its writer; this module holds the
parts that every writer needs: ``None`` left out, paths as text, times in UTC.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

import tomlkit
from tomlkit.items import Item, Table


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
