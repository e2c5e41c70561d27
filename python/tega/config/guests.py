"""Read the tables of a settings file that belong to features of other packages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import GenericAlias
from typing import Any, NamedTuple

import msgspec

from tega.config.sections import SessionConfig
from tega.runtime.features import call_member, features, load_target, named


class TableContext(NamedTuple):
    """Context of the check of a feature's table.

    Relative paths refer to ``base``; ``config`` holds the other settings of the session, checked.
    ``with_options`` is called with a table that names a driver, the driver's kind, such as ``"tracker"``, and
    the table's dotted key; it returns the table with the driver's options typed.
    """

    base: Path
    config: SessionConfig
    with_options: Callable[[Any, str, str], Any]


def read_guest_tables(
    given: Mapping[str, Any], context: TableContext, convert: Callable[[Any, Any, str], Any]
) -> dict[str, Any]:
    """Return the tables that were given, each as its feature's type and checked by its feature."""
    known = named("settings")
    found: dict[str, Any] = {}
    for key, tree in given.items():
        feature, target = known[key]
        kind = load_target(target, feature, (type(msgspec.Struct), GenericAlias), "msgspec Struct")
        table = convert(tree, kind, key)
        if feature.check:
            table = call_member(feature, "check", table, context, kind=type(table))
        found[key] = table
    return found


def guest_packages(config: SessionConfig) -> dict[str, str]:
    """Return the features whose tables the settings have, each with the package that brings it."""
    return {
        name: feature.requirement
        for name, feature in features().items()
        if config.guests.keys() & feature.settings.keys()
    }


def guest_files(config: SessionConfig) -> dict[str, Path]:
    """Return the files that features' tables name, to be kept with a recording, by the name they have there."""
    tables = [
        one for table in config.guests.values() for one in (table if isinstance(table, tuple) else (table,))
    ]
    return {name: path for one in tables if hasattr(one, "files") for name, path in one.files().items()}
